// One campaign: how it went, over any two parameters, and every run.
import { useMemo } from "preact/hooks";
import { address, VERDICTS, type Columns, type Verdict } from "./api";
import { brief, matcher, show, sorted, titled, valueOf, variantMatcher, variantOf, verdictOf, type Run, type Shown } from "./data";
import { FailureList } from "./failure-list";
import { failedFor } from "./failures";
import { count, duration, moment, plural } from "./format";
import { Grid, type Column } from "./grid";
import { useAnswer, type Versions } from "./live";
import { Sources, useAbout } from "./about";
import { Effects, isInCell, useAxes } from "./factors";
import { Matrix } from "./matrix";
import { Chooser, useMeasure } from "./measure";
import { MixedList } from "./mixed";
import { Notebooks } from "./notebooks";
import { LogSearch } from "./log-search";
import { Maps } from "./player/maps";
import { Parallel } from "./parallel";
import { Copy, Export, Folded, Mark, State, Tabs, VerdictBar, Waiting } from "./parts";
import { choose, link } from "./route";

const MOST_COLUMNS = 8;

/** Also of a campaign that was removed: to ask again says so. */
export function isStale(data: Columns, versions: Versions): boolean {
  const version = versions[data.summary.name];
  return version !== undefined && version !== data.summary.version;
}

export function CampaignPage({ name, query }: { name: string; query: URLSearchParams }) {
  const { data, error } = useAnswer<Columns>(address(["campaigns", name]), isStale);
  if (!data) return <Waiting error={error} title={name} />;
  return (
    <>
      <Head data={data} />
      <Body data={data} query={query} />
    </>
  );
}

function Head({ data }: { data: Columns }) {
  const { summary } = data;
  const about = useAbout(summary.name);
  const { execution } = summary;
  const facts: [string, string][] = [
    ["Started", moment(summary.started_at)],
    ["Duration", duration(summary.duration)],
    ["Configurations", count(summary.variants)],
    ["Image", show(execution.image || null)],
    ["Executed", show(execution.execution_type ?? null)],
    ["RoboVAST", show(execution.robovast_version ?? null)],
  ];
  return (
    <div class="head">
      <h1>
        {summary.name} <State state={summary.state} />
      </h1>
      {about?.title && <p class="title">{about.title}</p>}
      {about?.description && <p class="description">{about.description}</p>}
      <VerdictBar summary={summary} />
      {data.active.length > 0 && (
        <p class="active">
          Running now:{" "}
          {data.active.map((job) => (
            <a key={job.name} class="button" href={link(["job", summary.name, job.name])}>
              {job.name}
            </a>
          ))}
        </p>
      )}
      {data.resume && (
        <div class="command">
          <span id="resume">Continue</span>
          <code tabIndex={0} aria-labelledby="resume">
            {data.resume}
          </code>
          <Copy text={data.resume} label="Copy" />
        </div>
      )}
      <Folded title="About this campaign">
        <dl class="facts">
          {facts.map(([key, value]) => (
            <div key={key}>
              <dt>{key}</dt>
              <dd>{value}</dd>
            </div>
          ))}
        </dl>
      </Folded>
    </div>
  );
}

function Body({ data, query }: { data: Columns; query: URLSearchParams }) {
  const axes = useAxes(data, query);
  const about = useAbout(data.summary.name);
  const { names } = axes;
  const text = query.get("q") ?? "";
  const wanted = query.get("verdict") ?? "";
  const cell = query.get("cell") ?? "";
  const sort = query.get("sort") ?? "verdict";
  const colour = query.get("colour") ?? "";
  const aggregate = query.get("of") ?? "mean";
  const measure = useMeasure(data, colour, aggregate);

  const cause = query.get("cause") ?? "";
  const isCause = useMemo(() => (cause ? failedFor(data, cause) : undefined), [data, cause]);
  const rated = useMemo(() => data.runs.number.map((_, run) => run).filter(variantMatcher(data, text)), [data, text]);
  const found = useMemo(() => filtered(data, text, wanted, isCause), [data, text, wanted, isCause]);
  const inCell = useMemo(
    () => found.filter((run) => isInCell(axes, cell, data.runs.variant[run]!)),
    [data, found, axes.across, axes.down, cell],
  );
  const rows = useMemo(() => sorted(data, inCell, sort, measure), [data, inCell, sort, measure]);
  const columns = useMemo(
    () => columnsOf(data, names, colour === "duration" ? null : measure),
    [data, names, colour, measure],
  );
  const causes = <FailureList {...{ data, names }} runs={rated} chosen={cause} />;
  const overParameters = [
    {
      id: "matrix",
      label: "Matrix",
      show: () => (
        <div class="beside">
          <div>
            <Matrix
              {...{ data, axes, measure, chosen: cell, isBad: isCause }}
              runs={rated}
              chooser={<Chooser campaign={data.summary.name} colour={colour} aggregate={aggregate} />}
            />
          </div>
          <div>
            {causes}
            <Effects {...{ data, axes }} />
          </div>
        </div>
      ),
    },
    { id: "parallel", label: "Parallel coordinates", show: () => <Parallel {...{ data, names }} runs={inCell} /> },
  ];
  const views = [
    ...(names.length > 0 ? overParameters : []),
    {
      id: "mixed",
      label: "Mixed verdicts",
      show: () => <MixedList {...{ data, names }} runs={rated} sort={query.get("mixed") ?? ""} />,
    },
    { id: "maps", label: "Maps", show: () => <Maps data={data} runs={rated} /> },
    { id: "logs", label: "Logs", show: () => <LogSearch {...{ data, query }} runs={inCell} /> },
    {
      id: "notebooks",
      label: "Notebooks",
      show: () => <Notebooks title="For the campaign" target={{ campaign: data.summary.name }} />,
    },
  ];
  if (about) views.push({ id: "sources", label: "Document", show: () => <Sources about={about} /> });
  return (
    <>
      <Tabs tabs={views} chosen={query.get("view") ?? "matrix"} onChoose={(view) => choose({ view })} />
      {names.length === 0 && causes}
      <h2>Runs</h2>
      <div class="tools">
        <label class="choice">
          Find
          <input
            type="search"
            value={text}
            placeholder={names[0] ? `words, ${names[0]}=…, duration>2` : "words, duration>2"}
            onInput={(event) => choose({ q: event.currentTarget.value })}
          />
        </label>
        <VerdictFilter data={data} wanted={wanted} />
        {cause && (
          <button type="button" onClick={() => choose({ cause: "" })}>
            Only the chosen cause ✕
          </button>
        )}
        {cell && (
          <button type="button" onClick={() => choose({ cell: "" })}>
            Only the chosen cell ✕
          </button>
        )}
        <span class="quiet" role="status">
          {rows.length === data.runs.number.length
            ? plural(rows.length, "run")
            : `${count(rows.length)} of ${plural(data.runs.number.length, "run")}`}
        </span>
        <Export name={`${data.summary.name}-runs`} rows={() => exported(data, rows, names, measure)} />
      </div>
      {rows.length > 0 ? (
        <Grid
          label="Runs"
          columns={columns}
          rows={rows}
          sort={sort}
          onSort={(next) => choose({ sort: next === "verdict" ? "" : next })}
          open={(run) => (location.hash = runLink(data, run))}
          frozen={2}
        />
      ) : (
        <p class="hint">{data.runs.number.length ? "No run is like that." : "No run has ended yet."}</p>
      )}
    </>
  );
}

function filtered(data: Columns, text: string, wanted: string, isCause?: (run: Run) => boolean): Run[] {
  const matches = matcher(data, text);
  const verdicts = new Set(wanted.split(",").filter(Boolean));
  return data.runs.number
    .map((_, run) => run)
    .filter(
      (run) =>
        (!verdicts.size || verdicts.has(verdictOf(data, run))) && (!isCause || isCause(run)) && matches(run),
    );
}

function runLink(data: Columns, run: Run): string {
  return link(["campaign", data.summary.name, variantOf(data, run), data.runs.number[run]!]);
}

function columnsOf(data: Columns, names: string[], measure: Shown | null): Column[] {
  const value = (column: string) => (run: Run) => {
    const found = valueOf(data, run, column);
    return typeof found === "object" && found ? <span title={show(found)}>{brief(found)}</span> : show(found);
  };
  return [
    { id: "verdict", label: "Verdict", cell: (run) => <Mark verdict={verdictOf(data, run)} /> },
    {
      id: "variant",
      label: "Run",
      cell: (run) => (
        <a href={runLink(data, run)}>
          {variantOf(data, run)}/{data.runs.number[run]}
        </a>
      ),
    },
    ...(data.decided.length
      ? [{ id: "decided", label: "Configuration", cell: (run: Run) => data.decided[data.runs.variant[run]!] }]
      : []),
    { id: "reason", label: "Reason", cell: (run) => <Reason text={data.reasons[data.runs.reason[run]!]!} /> },
    ...names.slice(0, MOST_COLUMNS).map((name): Column => {
      const kind = data.variants.values[name]!.some((one) => typeof one === "number") ? "number" : "text";
      return { id: `p:${name}`, label: titled(data, name), kind, cell: value(`p:${name}`) };
    }),
    {
      id: "duration",
      label: "Duration",
      kind: "number",
      cell: (run) => duration(data.runs.duration[run]),
    },
    ...(measure
      ? [{ id: "m", label: measure.name, kind: "number" as const, cell: (run: Run) => show(measure.of(run)) }]
      : []),
    { id: "started", label: "Started", cell: (run) => moment(data.runs.started[run]) },
  ];
}

function Reason({ text }: { text: string }) {
  return <span title={text}>{text || "–"}</span>;
}

function exported(data: Columns, rows: Run[], names: string[], measure: Shown | null): unknown[][] {
  const head = ["variant", "run", "verdict", ...names.map((name) => `p:${name}`), "duration", "started", "reason"];
  const label = (column: string) => column.replace(/^p:/, "");
  const extra = measure && measure.name !== "duration [s]" ? [measure] : [];
  return [
    [...head.map(label), ...extra.map(({ name }) => name)],
    ...rows.map((run) => [
      ...head.map((column) => valueOf(data, run, column)),
      ...extra.map(({ of }) => of(run)),
    ]),
  ];
}

function VerdictFilter({ data, wanted }: { data: Columns; wanted: string }) {
  const chosen = new Set(wanted.split(",").filter(Boolean));
  const toggle = (verdict: Verdict) => {
    if (chosen.has(verdict)) chosen.delete(verdict);
    else chosen.add(verdict);
    choose({ verdict: [...chosen].join() });
  };
  return (
    <span class="chips" role="group" aria-label="Verdicts">
      {VERDICTS.filter((verdict) => data.summary.counts[verdict] || chosen.has(verdict)).map((verdict) => (
        <button key={verdict} type="button" aria-pressed={chosen.has(verdict)} onClick={() => toggle(verdict)}>
          <Mark verdict={verdict} /> {count(data.summary.counts[verdict])}
        </button>
      ))}
    </span>
  );
}
