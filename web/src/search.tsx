// A search: where it fails, how far it is, and how it goes on.
import { useMemo, useRef, useState } from "preact/hooks";
import { address, type Columns } from "./api";
import { show } from "./data";
import { Field } from "./field";
import { percent } from "./format";
import { useAnswer, type Answer } from "./live";
import { Copy, Export, Prose, Select, Waiting, type Option } from "./parts";
import { Plot } from "./plot";
import { choose, link } from "./route";
import { curveGroups, intervalText, usualAxes, type Critical, type Dimension, type MapAnswer, type SearchAnswer, type SetsAnswer } from "./search-data";
import { COMMON, SEARCH } from "./text";

/** Runs beyond what is stored that are offered, as a share of it. */
const MORE = 0.5;

export function SearchView({ data, query }: { data: Columns; query: URLSearchParams }) {
  const { name } = data.summary;
  const { data: search, error } = useAnswer<SearchAnswer>(
    address(["search", name]),
    (answer, versions) => (versions[name] ?? answer.version) !== answer.version,
  );
  if (!search) return <Waiting error={error} />;
  return (
    <div class="search">
      <Status {...{ search, data }} />
      {search.evaluated > 0 && <Found {...{ search, data, query }} />}
      <Progress search={search} />
      {search.left_out > 0 && <LeftOut {...{ search, data }} />}
      <More {...{ search }} />
    </div>
  );
}

function Status({ search, data }: { search: SearchAnswer; data: Columns }) {
  const isRunning = data.summary.state === "running";
  const reason = search.ended?.reason.replace(`${search.ended.kind}: `, "").replace(/\.$/, "");
  const state = reason ? SEARCH.finished(reason) : isRunning ? SEARCH.running : SEARCH.unfinished;
  const version = search.proposed.at(-1)?.[2];
  return (
    <>
      <p class="search-state">
        <strong>{state}</strong> {SEARCH.evaluated(search.evaluated, search.batches, search.left_out)} {SEARCH.strategy}{" "}
        <code>{search.strategy}</code>
        {SEARCH.version(version, search.seed)}
      </p>
      <ul class="criteria" aria-label={SEARCH.criteria}>
        {search.criteria.map(({ kind, label, current, limit, fired }, index) => (
          <li key={index} class={fired ? "fired" : undefined} title={kind}>
            {label} <b>{current === null ? "–" : show(Number(current.toPrecision(4)))}</b> / {show(limit)}
          </li>
        ))}
      </ul>
      {!search.built_in && (
        <p class="hint">
          <Prose text={SEARCH.custom} />
        </p>
      )}
    </>
  );
}

interface FoundProps {
  search: SearchAnswer;
  data: Columns;
  query: URLSearchParams;
}

function Found({ search, data, query }: FoundProps) {
  const { name } = data.summary;
  const options = optionsOf(search);
  const isAxis = (axis: string | null) => options.some(([value]) => value === axis);
  const [first, second] = usualAxes(search);
  const x = isAxis(query.get("across")) ? query.get("across")! : first;
  const y = isAxis(query.get("down")) ? query.get("down")! : second === x ? first : second;
  const dimension = (axis: string) => search.dimensions.find((one) => one.name === axis);
  const isMap = search.shown === "map" && x !== y && Boolean(dimension(x) && dimension(y));
  const at = placeIn(query.get("at") ?? "");
  const setAt = (next: Record<string, number>) => choose({ at: JSON.stringify(next) });
  const asked = { x, y, after: search.batches }; // what was answered before a batch is not asked for again
  const sets = useKept(useAnswer<SetsAnswer>(address(["search", name, "sets"], asked)), `${x}/${y}`);
  const place = Object.keys(at).length ? JSON.stringify(at) : "";
  const map = useKept(useAnswer<MapAnswer>(isMap ? address(["search", name, "map"], { ...asked, at: place }) : null), `${x}/${y}`);
  const unsure = isMap && query.get("shade") === "unsure";
  const objective = search.objectives[0]!.name;
  const values = sets.data?.value ?? [];
  const scale = useMemo(() => scaleOf(values, search.shown === "map"), [sets.data]);
  const isChoice = (axis: string) => ["choice", "bool"].includes(dimension(axis)?.type ?? "");
  const describe = (set: number) => description(search, data, sets.data!, set);
  const open = (set: number) => (location.hash = link(["campaign", name, sets.data!.config[set]!, 0]));
  return (
    <>
      <div class="tools">
        <Select label={COMMON.across} value={x} options={options} onChoose={(across) => choose({ across })} />
        <Select label={SEARCH.up} value={y} options={options} onChoose={(down) => choose({ down })} />
        {isMap && (
          <Select
            label={COMMON.color}
            value={query.get("shade") ?? ""}
            options={[["", COMMON.failureRate], ["unsure", SEARCH.width]]}
            onChoose={(shade) => choose({ shade })}
          />
        )}
        <span class={`legend ${unsure ? "measure" : "rate"}`}>
          {isMap ? (unsure ? SEARCH.certain : percent(0)) : `${objective} ${show(Number(scale[0].toPrecision(3)))}`} <span class="ramp" aria-hidden="true" />{" "}
          {isMap ? (unsure ? SEARCH.uncertain : percent(1)) : show(Number(scale[1].toPrecision(3)))}
        </span>
        {sets.data && <Export name={`${name}-sets`} rows={() => exported(search, data, sets.data!)} />}
      </div>
      {sets.error !== null && <p class="error" role="alert">{sets.error}</p>}
      {map.error !== null && <p class="error" role="alert">{map.error}</p>}
      <div class={isMap ? "beside" : undefined}>
        <div>
          {sets.data ? (
            <Field
              label={SEARCH.field(search.evaluated, x, y)}
              sets={sets.data}
              map={isMap ? map.data : null}
              isLate={isMap && map.isLate}
              lined={!isChoice(x) && !isChoice(y)}
              {...{ unsure, scale, describe, open }}
            />
          ) : (
            sets.error === null && <Waiting error={null} />
          )}
          {isMap && map.isLate && map.error === null && <Waiting error={null} what={SEARCH.computing(!map.data)} />}
          {isMap && map.data && !map.isLate && (
            <p class="quiet note">
              {SEARCH.lines(map.data.level)}
            </p>
          )}
        </div>
        {isMap && (
          <div>
            <Shares search={search} />
            <Place {...{ search, at, setAt }} axes={[x, y]} values={map.data?.values ?? {}} />
            {map.data && <CriticalValues found={map.data.critical} name={name} />}
          </div>
        )}
      </div>
    </>
  );
}

/** The place that an address names, by dimension. */
function placeIn(text: string): Record<string, number> {
  try {
    const found: unknown = JSON.parse(text);
    if (typeof found !== "object" || found === null) return {};
    return Object.fromEntries(Object.entries(found).filter(([, place]) => typeof place === "number" && place >= 0 && place <= 1));
  } catch {
    return {};
  }
}

/** The last answer while the next one is on its way, as long as it is of the same kind. */
function useKept<T>(answer: Answer<T>, kind: string): Answer<T> & { isLate: boolean } {
  const kept = useRef<{ kind: string; data: T | null }>({ kind, data: null });
  if (answer.data || kept.current.kind !== kind) kept.current = { kind, data: answer.data };
  return answer.error === null ? { data: kept.current.data, error: null, isLate: !answer.data } : { ...answer, isLate: false };
}

function optionsOf(search: SearchAnswer): Option[] {
  return [
    ...search.dimensions.map(({ name }): Option => [name, name, SEARCH.parameters]),
    ...search.objectives.map(({ name }): Option => [name, name, SEARCH.objectives]),
    ...search.measures.map((name): Option => [name, name, SEARCH.measures]),
  ];
}

function scaleOf(values: number[], isRate: boolean): [number, number] {
  if (isRate || !values.length) return [0, 1];
  return values.reduce<[number, number]>(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
}

function description(search: SearchAnswer, data: Columns, sets: SetsAnswer, set: number): string {
  const config = sets.config[set]!;
  const batch = sets.batch[set]!;
  const variant = data.variants.name.indexOf(config);
  const values = search.dimensions
    .map(({ name }) => [name, data.variants.values[name]?.[variant]] as const)
    .filter(([, value]) => value !== undefined)
    .map(([name, value]) => `${name} ${show(value)}`);
  const [, told, version, strategy] = search.proposed[batch]!;
  const rate = SEARCH.objective(search.objectives[0]!.name, show(Number(sets.value[set]!.toPrecision(3))), sets.runs[set]!);
  return [config, rate, ...values, SEARCH.batch(batch), SEARCH.proposed(strategy, version, told)].join(" · ");
}

function exported(search: SearchAnswer, data: Columns, sets: SetsAnswer): unknown[][] {
  const names = search.dimensions.map(({ name }) => name);
  const variants = new Map(data.variants.name.map((name, index) => [name, index]));
  return [
    ["config", "batch", ...names, search.objectives[0]!.name, "runs"],
    ...sets.config.map((config, set) => [
      config,
      sets.batch[set],
      ...names.map((name) => data.variants.values[name]?.[variants.get(config)!]),
      sets.value[set],
      sets.runs[set],
    ]),
  ];
}

/** How much of the space fails, by the last batch. */
function Shares({ search }: { search: SearchAnswer }) {
  const last = (name: string) => search.report[name]?.at(-1) ?? null;
  const [share, low, high, wrong] = [last("failing"), last("failing_low"), last("failing_high"), last("misjudged")];
  if (share === null || low === null || high === null) return null;
  return (
    <>
      <h2>{SEARCH.failing}</h2>
      <p class="share">
        <strong>{percent(share)}</strong>
        {SEARCH.ofSpace(low, high)}
        {wrong !== null && <span class="quiet">{SEARCH.misjudged(wrong)}</span>}
      </p>
    </>
  );
}

interface PlaceProps {
  search: SearchAnswer;
  at: Record<string, number>;
  setAt: (at: Record<string, number>) => void;
  axes: string[];
  values: Record<string, unknown>;
}

/** Where the map lies, and the point that the critical values belong to. */
function Place({ search, at, setAt, axes, values }: PlaceProps) {
  const dimensions = search.dimensions.filter(({ ticks }) => ticks.length > 1);
  return (
    <>
      <h2>{SEARCH.others}</h2>
      <div class="place-of">
        {dimensions.map((dimension) => (
          <Slider
            key={dimension.name}
            dimension={dimension}
            place={at[dimension.name] ?? 0.5}
            value={valueAt(values, dimension.name)}
            remark={axes.includes(dimension.name) ? SEARCH.forCritical : ""}
            onChange={(place) => setAt({ ...at, [dimension.name]: place })}
          />
        ))}
      </div>
    </>
  );
}

function valueAt(values: Record<string, unknown>, name: string): string {
  const value = Object.hasOwn(values, name) ? values[name] : null;
  return show(typeof value === "number" ? Number(value.toPrecision(4)) : value);
}

interface SliderProps {
  dimension: Dimension;
  place: number;
  value: string;
  remark: string;
  onChange: (place: number) => void;
}

function Slider({ dimension: { name, type, ticks }, place, value, remark, onChange }: SliderProps) {
  const isChoice = type === "choice" || type === "bool";
  const chosen = ticks.reduce((best, tick) => (Math.abs(tick[0] - place) < Math.abs(best[0] - place) ? tick : best));
  return (
    <label>
      <span>
        {name} {!isChoice && <b>{value}</b>} {remark && <small>{remark}</small>}
      </span>
      {isChoice ? (
        <select value={String(chosen[0])} onChange={(event) => onChange(Number(event.currentTarget.value))}>
          {ticks.map(([spot, text]) => (
            <option key={spot} value={String(spot)}>
              {text}
            </option>
          ))}
        </select>
      ) : (
        <input
          type="range"
          min={0}
          max={1}
          step={0.02}
          value={place}
          aria-valuetext={value}
          onChange={(event) => onChange(Number(event.currentTarget.value))}
        />
      )}
      {!isChoice && (
        <small>
          {ticks[0]![1]} … {ticks.at(-1)![1]}
        </small>
      )}
    </label>
  );
}

function CriticalValues({ found, name }: { found: Critical[]; name: string }) {
  const number = (value: number | null) => (value === null ? "–" : show(Number(value.toPrecision(3))));
  return (
    <>
      <h2>{SEARCH.critical}</h2>
      <div class="scroll" tabIndex={0} role="region" aria-label={SEARCH.critical}>
        <table class="plain">
          <thead>
            <tr>
              <th scope="col">{SEARCH.parameter}</th>
              <th scope="col" class="number">{SEARCH.value}</th>
              <th scope="col" class="number">{COMMON.interval}</th>
              <th scope="col">{SEARCH.above}</th>
              <th scope="col" class="number">{SEARCH.crossing}</th>
            </tr>
          </thead>
          <tbody>
            {found.map((one) => (
              <tr key={`${one.name} ${one.value}`}>
                <th scope="row">{one.name}</th>
                <td class="number">{number(one.value)}</td>
                <td class="number">{intervalText(one, number)}</td>
                <td>{one.above ?? "–"}</td>
                <td class="number">{percent(one.crossing)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <Export
        name={`${name}-critical`}
        rows={() => [
          ["parameter", "critical", "low", "high", "above", "crossing", "open"],
          ...found.map((one) => [one.name, one.value, one.low, one.high, one.above, one.crossing, one.open]),
        ]}
      />
    </>
  );
}

/** The best value and the strategy's numbers, batch by batch. */
function Progress({ search }: { search: SearchAnswer }) {
  const batches = search.report.batch ?? [];
  const groups = useMemo(() => curveGroups(search.report), [search]);
  const x = useMemo(() => ({ label: SEARCH.batches, values: batches }), [search]);
  const curves = useMemo(
    () => groups.map((group) => group.map((label) => ({ label, values: search.report[label]! }))),
    [search],
  );
  if (!batches.length) return <p class="hint">{SEARCH.noBatch}</p>;
  return (
    <section aria-labelledby="progress">
      <h2 id="progress">{SEARCH.progress}</h2>
      <div class="curves">
      {curves.map((group) => (
        <div key={group[0]!.label}>
          <h3>{group[0]!.label}</h3>
          <Plot label={group[0]!.label} x={x} curves={group} height={170} legend={group.length > 1} />
        </div>
      ))}
      </div>
    </section>
  );
}

function LeftOut({ search, data }: { search: SearchAnswer; data: Columns }) {
  return (
    <details>
      <summary>{SEARCH.skipped(search.left_out)}</summary>
      <ul>
        {search.errors.map(([config, error]) => (
          <li key={config}>
            <a href={link(["campaign", data.summary.name, config, 0])}>{config}</a> {error}
          </li>
        ))}
        {search.left_out > search.errors.length && <li class="quiet">{COMMON.andMore(search.left_out - search.errors.length)}</li>}
      </ul>
    </details>
  );
}

/** The command that gives the search a larger budget. */
function More({ search }: { search: SearchAnswer }) {
  const [wanted, setWanted] = useState(0);
  const usual = search.batches + Math.max(1, Math.ceil(MORE * search.batches));
  const batches = wanted > search.batches ? wanted : usual;
  if (!search.more) return null;
  const command = search.more.join(String(batches));
  return (
    <>
      <h2>{SEARCH.more}</h2>
      <div class="tools">
        <label class="choice">
          {SEARCH.total}
          <input
            type="number"
            min={search.batches + 1}
            value={batches}
            onChange={(event) => setWanted(Math.round(Number(event.currentTarget.value)) || 0)}
          />
        </label>
      </div>
      <div class="command">
        <span id="more">{SEARCH.command}</span>
        <code tabIndex={0} aria-labelledby="more">
          {command}
        </code>
        <Copy text={command} />
      </div>
    </>
  );
}
