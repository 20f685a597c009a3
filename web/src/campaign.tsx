// One campaign: how it went, over any two parameters, and every run.
import { useMemo } from "preact/hooks";
import { address, VERDICTS, type Columns, type Verdict } from "./api";
import { StillReading, useBegun } from "./begun";
import { ColumnsPick, runLink, useColumns } from "./columns";
import { among, matcher, misspelt, show, sorted, valueOf, variantMatcher, verdictOf, type Run, type Shown } from "./data";
import { FailureList } from "./failure-list";
import { failedFor } from "./failures";
import { count, duration, moment } from "./format";
import { Grid } from "./grid";
import { useAnswer, type Versions } from "./live";
import { Sources, useAbout } from "./about";
import { StartedOn } from "./launched";
import { AxesNote, Effects, isInCell, useAxes, type Axes } from "./factors";
import { Matrix } from "./matrix";
import { Chooser, useMeasure } from "./measure";
import { MixedList } from "./mixed";
import { BatchNotebooks, Notebooks } from "./notebooks";
import { LogSearch } from "./log-search";
import { Maps } from "./player/maps";
import { Parallel } from "./parallel/parallel";
import { inBrush, outcomes, readBrush, scaleOf } from "./parallel/scales";
import { Copy, Export, Folded, Mark, State, Tabs, VerdictBar, Waiting } from "./parts";
import { choose, link } from "./route";
import { RunMore } from "./run-more";
import { SearchView } from "./search";
import { CAMPAIGN, COMMON, NOTEBOOKS } from "./text";

/** Also of a campaign that was removed: to ask again says so. */
export function isStale(data: Columns, versions: Versions): boolean {
  const version = versions[data.summary.name];
  return version !== undefined && version !== data.summary.version;
}

export function CampaignPage({ name, query }: { name: string; query: URLSearchParams }) {
  const { data: whole, error } = useAnswer<Columns>(address(["campaigns", name]), isStale);
  const begun = useBegun(name, !whole && !error);
  const data = whole ?? begun;
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
    [COMMON.started, moment(summary.started_at)],
    [COMMON.duration, duration(summary.duration)],
    [COMMON.configurations, count(summary.variants)],
    [COMMON.image, show(execution.image || null)],
    [CAMPAIGN.execution, show(execution.execution_type ?? null)],
    [CAMPAIGN.version, show(execution.robovast_version ?? null)],
  ];
  return (
    <div class="head">
      <h1>
        {summary.name} {data.reading ? <StillReading reading={data.reading} /> : <State state={summary.state} />}
      </h1>
      {about?.title && <p class="title">{about.title}</p>}
      {about?.description && <p class="description">{about.description}</p>}
      <VerdictBar summary={summary} />
      {data.active.length > 0 && (
        <p class="active">
          {CAMPAIGN.runningNow}{" "}
          {data.active.map((job) => (
            <a key={job.name} class="button" href={link(["job", summary.name, job.name])}>
              {job.name}
            </a>
          ))}
        </p>
      )}
      {data.resume && (
        <div class="command">
          <span id="resume">{CAMPAIGN.resume}</span>
          <code tabIndex={0} aria-labelledby="resume">
            {data.resume}
          </code>
          <Copy text={data.resume} />
        </div>
      )}
      <StartedOn campaign={summary.name} counted />
      <Folded title={CAMPAIGN.details}>
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
  const column = colour === "duration" ? null : measure;

  const cause = query.get("cause") ?? "";
  const isCause = useMemo(() => (cause ? failedFor(data, cause) : undefined), [data, cause]);
  const rated = useMemo(() => data.runs.number.map((_, run) => run).filter(variantMatcher(data, text)), [data, text]);
  const found = useMemo(() => filtered(data, text, wanted, isCause), [data, text, wanted, isCause]);
  const inCell = useMemo(
    () => found.filter((run) => isInCell(axes, cell, data.runs.variant[run]!)),
    [data, found, axes.across, axes.down, cell],
  );
  const brushed = query.get("brush") ?? "";
  const brush = useMemo(() => readBrush(brushed), [brushed]);
  const inLines = useMemo(() => {
    if (!Object.keys(brush).length) return inCell;
    const results = outcomes(data, inCell, column);
    const isIn = inBrush(brush, (id) => scaleOf(data, results, id, column));
    return inCell.filter((run) => isIn(data.runs.variant[run]!));
  }, [data, inCell, column, brush]);
  // All are sorted once, not again with each choice among them.
  const inOrder = useMemo(() => sorted(data, [...data.runs.number.keys()], sort, measure), [data, sort, measure]);
  const rows = useMemo(() => among(inOrder, inLines), [inOrder, inLines]);
  const columns = useColumns(data, names, column, query.get("columns") ?? "");
  const causes = <FailureList {...{ data, names }} runs={rated} chosen={cause} />;
  const overParameters = [
    {
      id: "matrix",
      label: CAMPAIGN.matrix,
      show: () => (
        <div class="beside">
          <div>
            <AxesNote axes={axes} />
            <Matrix
              {...{ data, axes, measure, chosen: cell, isBad: isCause }}
              runs={rated}
              chooser={<Chooser campaign={data.summary.name} colour={colour} aggregate={aggregate} />}
            />
            {cell && <RunMore campaign={data.summary.name} configurations={openIn(data, axes, cell)} />}
          </div>
          <div>
            {causes}
            <Effects {...{ data, axes }} />
          </div>
        </div>
      ),
    },
    {
      id: "parallel",
      label: CAMPAIGN.parallel,
      show: () => (
        <Parallel {...{ data, names, brush }} runs={inCell} measure={column} axes={query.get("axes") ?? ""} />
      ),
    },
  ];
  const search = { id: "search", label: CAMPAIGN.search, show: () => <SearchView {...{ data, query }} /> };
  const views = [
    ...(data.search ? [search] : []),
    ...(names.length > 0 ? overParameters : []),
    {
      id: "mixed",
      label: CAMPAIGN.mixed,
      show: () => <MixedList {...{ data, names }} runs={rated} sort={query.get("mixed") ?? ""} />,
    },
    { id: "maps", label: CAMPAIGN.maps, show: () => <Maps data={data} runs={rated} /> },
    { id: "logs", label: CAMPAIGN.logs, show: () => <LogSearch {...{ data, query }} runs={inLines} /> },
    {
      id: "notebooks",
      label: CAMPAIGN.notebooks,
      show: () => (
        <>
          <Notebooks title={NOTEBOOKS.ofCampaign} target={{ campaign: data.summary.name }} />
          {data.search && <BatchNotebooks campaign={data.summary.name} chosen={query.get("batch")} />}
        </>
      ),
    },
  ];
  if (about) views.push({ id: "sources", label: CAMPAIGN.sources, show: () => <Sources about={about} /> });
  return (
    <>
      <Tabs tabs={views} chosen={query.get("view") ?? (data.search ? "search" : "matrix")} onChoose={(view) => choose({ view })} />
      {names.length === 0 && causes}
      <h2>{COMMON.runs}</h2>
      <div class="tools">
        <label class="choice">
          {COMMON.filter}
          <input
            type="search"
            value={text}
            placeholder={CAMPAIGN.example(names[0])}
            onInput={(event) => choose({ q: event.currentTarget.value })}
          />
        </label>
        <VerdictFilter data={data} wanted={wanted} />
        {cause && (
          <button type="button" onClick={() => choose({ cause: "" })}>
            {CAMPAIGN.onlyCause}
          </button>
        )}
        {brushed && (
          <button type="button" onClick={() => choose({ brush: "" })}>
            {CAMPAIGN.onlyLines}
          </button>
        )}
        {cell && (
          <button type="button" onClick={() => choose({ cell: "" })}>
            {COMMON.onlyCell}
          </button>
        )}
        <span class="quiet" role="status">
          {COMMON.someRuns(rows.length, data.runs.number.length)}
        </span>
        <ColumnsPick {...columns} />
        <Export name={`${data.summary.name}-${data.reading ? "some-" : ""}runs`} rows={() => exported(data, rows, names, measure)} />
      </div>
      <Misspelt {...{ data, text }} />
      {rows.length > 0 ? (
        <Grid
          label={COMMON.runs}
          columns={columns.shown}
          rows={rows}
          sort={sort}
          onSort={(next) => choose({ sort: next === "verdict" ? "" : next })}
          open={(run) => (location.hash = runLink(data, run))}
          frozen={2}
        />
      ) : (
        <p class="hint">{data.runs.number.length ? CAMPAIGN.noMatch : CAMPAIGN.noRuns}</p>
      )}
    </>
  );
}

/** The configurations of a cell whose runs are not enough. */
function openIn(data: Columns, axes: Axes, cell: string): string[] {
  const isOpen = (variant: number) => data.decided[variant]?.startsWith("inconclusive") ?? true;
  return data.variants.name.filter((_, variant) => isInCell(axes, cell, variant) && isOpen(variant));
}

/** Conditions on what is no column, which are looked for as words. */
function Misspelt({ data, text }: { data: Columns; text: string }) {
  const found = misspelt(data, text);
  if (!found.length) return null;
  return (
    <p class="hint" aria-live="polite">
      {found.map(({ name, like }) => (
        <span key={name}>
          {CAMPAIGN.unknown(name)}{" "}
          {like && (
            <>
              {CAMPAIGN.similar}{" "}
              <button type="button" onClick={() => choose({ q: text.replace(name, () => like) })}>
                {like}
              </button>{" "}
            </>
          )}
        </span>
      ))}
    </p>
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

function exported(data: Columns, rows: Run[], names: string[], measure: Shown | null): unknown[][] {
  const head = ["variant", "run", "verdict", ...names.map((name) => `p:${name}`), "duration", "started", "reason"];
  const label = (column: string) => column.replace(/^p:/, "");
  const extra = measure && measure.name !== COMMON.durationInSeconds ? [measure] : [];
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
    <span class="chips" role="group" aria-label={CAMPAIGN.verdicts}>
      {VERDICTS.filter((verdict) => data.summary.counts[verdict] || chosen.has(verdict)).map((verdict) => (
        <button key={verdict} type="button" aria-pressed={chosen.has(verdict)} onClick={() => toggle(verdict)}>
          <Mark verdict={verdict} /> {count(data.summary.counts[verdict])}
        </button>
      ))}
    </span>
  );
}
