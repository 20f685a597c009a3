// Running a campaign from here: what it would run.
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useState } from "preact/hooks";
import { address, post, type Offer, type VariantColumns } from "./api";
import { factors, order, show } from "./data";
import { chosen } from "./expansion";

import { Grid } from "./grid";
import { Progress, Refusal, useStarter } from "./launched";
import { useAnswer, useLaunch } from "./live";
import { Export, Select, Waiting } from "./parts";
import { choose, link } from "./route";
import { COMMON, START } from "./text";


export function StartPage({ query }: { query: URLSearchParams }) {
  const { data: offer, error } = useAnswer<Offer>(address(["offer"]));
  const launched = useLaunch();
  if (!offer) return <Waiting error={error} title={START.title} />;
  const progress = launched && <Progress key={launched.launch.number} launched={launched} />;
  return (
    <>
      <div class="head">
        <h1>{START.title}</h1>
        {offer.document ? (
          <p class="quiet">
            {START.from} <code>{offer.document}</code>
          </p>
        ) : (
          <p class="hint">{offer.refusal}</p>
        )}
      </div>
      {offer.document ? (
        <Choices {...{ offer, query }}>{progress}</Choices>
      ) : (
        progress
      )}
    </>
  );
}

interface ChoicesProps {
  offer: Offer;
  query: URLSearchParams;
  /** What was started the last time. */
  children: ComponentChildren;
}

function Choices({ offer, query, children }: ChoicesProps) {
  const [variants, fault, readAgain] = useExpansion();
  const config = query.get("config") ?? "";
  const rows = useMemo(() => (variants ? chosen(variants, config) : []), [variants, config]);
  const runs = Number(query.get("runs")) || offer.runs;
  return (
    <>
      <div class="tools">
        <label class="choice">
          {COMMON.configurations}
          <input
            type="search"
            value={config}
            placeholder={START.placeholder}
            onInput={(event) => choose({ config: event.currentTarget.value })}
          />
        </label>
        <Count label={START.runs} name="runs" query={query} otherwise={String(offer.runs)} />
        <Count label={START.jobs} name="jobs" query={query} otherwise="auto" />
        <Select
          label={START.runtime}
          value={query.get("runtime") ?? ""}
          options={START.runtimes}
          onChoose={(runtime) => choose({ runtime })}
        />
      </div>
      <Starter query={query} what={variants && START.selection(rows.length, rows.length * runs)} />
      {children}
      <h2>{COMMON.configurations}</h2>
      {fault && (
        <p class="error" role="alert">
          {fault}
        </p>
      )}
      {variants && <Expansion {...{ variants, rows, query }} />}
      {!variants && !fault && <p class="loading">{START.expanding}</p>}
      {(variants || fault) && (
        <button type="button" onClick={readAgain}>
          {START.reload}
        </button>
      )}
    </>
  );
}

/** The configurations, why there are none, and what asks for them again. */
function useExpansion(): [VariantColumns | null, string, () => void] {
  const [variants, setVariants] = useState<VariantColumns | null>(null);
  const [fault, setFault] = useState("");
  const read = () => {
    setVariants(null);
    setFault("");
    post<VariantColumns>(address(["expansion"])).then(setVariants, (cause: Error) => setFault(cause.message));
  };
  useEffect(read, []);
  return [variants, fault, read];
}

interface CountProps {
  label: string;
  name: string;
  query: URLSearchParams;
  otherwise: string;
}

function Count({ label, name, query, otherwise }: CountProps) {
  return (
    <label class="choice">
      {label}
      <input
        type="number"
        min={1}
        max={999999}
        value={query.get(name) ?? ""}
        placeholder={otherwise}
        onInput={(event) => choose({ [name]: event.currentTarget.value })}
      />
    </label>
  );
}

interface StarterProps {
  query: URLSearchParams;
  /** What would be run; null when that is not known. */
  what: string | null;
}

function Starter({ query, what }: StarterProps) {
  const { start, busy, refusal } = useStarter();
  return (
    <>
      <p class="tools">
        <button
          type="button"
          class="primary"
          disabled={busy}
          onClick={() => start(address(["start"], Object.fromEntries(query)))}
        >
          {START.run}
        </button>
        <span class="quiet" role="status">
          {busy ? START.busy : what}
        </span>
      </p>
      <Refusal text={refusal} />
    </>
  );
}

interface ExpansionProps {
  variants: VariantColumns;
  rows: number[];
  query: URLSearchParams;
}

function Expansion({ variants, rows, query }: ExpansionProps) {
  const names = useMemo(() => factors({ variants, factors: Object.keys(variants.values) }), [variants]);
  const sort = query.get("sort") ?? "";
  const column = (id: string) => (id === "name" ? variants.name : variants.values[id.slice(2)] ?? []);
  const shown = useMemo(() => {
    const keys = column(sort.replace(/^-/, ""));
    const sign = sort.startsWith("-") ? -1 : 1;
    return sort ? rows.toSorted((a, b) => sign * order(keys[a], keys[b])) : rows;
  }, [rows, sort]);
  const only = (row: number) => ({ ...Object.fromEntries(query), config: variants.name[row]! });
  if (!rows.length) return <p class="hint">{START.noMatch}</p>;
  return (
    <>
      <div class="tools">
        <Export
          name="configurations"
          rows={() => [
            ["name", ...names],
            ...shown.map((row) => [variants.name[row], ...names.map((name) => variants.values[name]![row])]),
          ]}
        />
      </div>
      <Grid
        label={COMMON.configurations}
        rows={shown}
        sort={sort}
        onSort={(next) => choose({ sort: next })}
        open={(row) => choose({ config: variants.name[row]! })}
        columns={[
          { id: "name", label: START.name, cell: (row) => <a href={link(["start"], only(row))}>{variants.name[row]}</a> },
          ...names.map((name) => ({
            id: `p:${name}`,
            label: name,
            kind: variants.values[name]!.some((one) => typeof one === "number") ? ("number" as const) : undefined,
            cell: (row: number) => show(variants.values[name]![row]),
          })),
        ]}
      />
    </>
  );
}
