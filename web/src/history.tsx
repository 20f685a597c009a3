// One configuration over campaigns: how often it failed, and what changed between.
import { useEffect, useRef, useState } from "preact/hooks";
import { address, type History, type HistoryEntry } from "./api";
import { order } from "./data";
import { moment, percent } from "./format";
import { Grid, type Column } from "./grid";
import { useAnswer } from "./live";
import { Export, Waiting } from "./parts";
import { intervalText } from "./rates";
import { link } from "./route";
import "./history.css";
import { COMMON, HISTORY } from "./text";

export function HistoryOf({ campaign, variant }: { campaign: string; variant: string }) {
  const { data, error } = useHistory(campaign, variant);
  if (!data) return <Waiting error={error} />;
  const { entries, others, pending } = data;
  return (
    <>
      <p>
        {HISTORY.about(variant, entries.length)}
        {others.length > 0 && HISTORY.others(variant, others.length)}
      </p>
      <p role="status" class="quiet">
        {pending > 0 && HISTORY.pending(pending)}
      </p>
      <ol class="history" aria-label={HISTORY.dots(variant)}>
        {entries.map((entry) => (
          <Dot key={entry.campaign} entry={entry} current={entry.campaign === campaign} />
        ))}
      </ol>
      <p class="quiet">{HISTORY.legend}</p>
      <Table entries={entries} name={variant} />
    </>
  );
}

/** Asks again until all campaigns were searched, and shows meanwhile what was found. */
function useHistory(campaign: string, variant: string) {
  const [attempt, setAttempt] = useState(0);
  const answer = useAnswer<History>(address(["history", campaign, variant], { attempt: String(attempt) }));
  const latest = useRef<History | null>(null);
  if (answer.data) latest.current = answer.data;
  useEffect(() => {
    if (answer.data?.pending) setAttempt(attempt + 1);
  }, [answer.data]);
  return { data: latest.current, error: answer.error };
}

function Dot({ entry, current }: { entry: HistoryEntry; current: boolean }) {
  const { campaign, name, changes, changed } = entry;
  const rate = entry.rate.rate ?? 0;
  const label = [campaign, outcome(entry), changed && HISTORY.changed(changed)].filter(Boolean).join("; ");
  return (
    <li class={changes.length > 0 ? "changed" : undefined} title={label}>
      {changes.length > 0 && <small>{changed}</small>}
      <a
        class={`dot ${rate > 0 ? "bad" : ""}`}
        style={{ "--share": `${100 * rate}%` }}
        href={configuration(campaign, name)}
        aria-label={label}
        aria-current={current ? "page" : undefined}
      />
      <small>{percent(rate)}</small>
    </li>
  );
}

function configuration(campaign: string, name: string): string {
  return link(["campaign", campaign], { q: `variant=${name}` });
}

function outcome(entry: HistoryEntry): string {
  return HISTORY.outcome(badOf(entry), entry.rate.runs);
}

function badOf({ rate }: HistoryEntry): number {
  return rate.failed + rate.errored;
}

function valueOf(entry: HistoryEntry, column: string): unknown {
  switch (column) {
    case "started":
      return entry.started_at;
    case "outcome":
    case "interval":
      return entry.rate.rate;
    case "changed":
      return entry.changed;
    case "campaign":
      return `${entry.campaign}/${entry.name}`;
    default:
      return column === "image" ? entry.image : entry.reason;
  }
}

/** Places of entries; equal ones stay in the order of their dates. */
function sorted(entries: HistoryEntry[], sort: string): number[] {
  const [sign, column] = sort.startsWith("-") ? [-1, sort.slice(1)] : [1, sort];
  const of = (row: number) => valueOf(entries[row]!, column);
  return entries.map((_, row) => row).sort((a, b) => sign * order(of(a), of(b)) || a - b);
}

function Table({ entries, name }: { entries: HistoryEntry[]; name: string }) {
  const [sort, setSort] = useState("-started"); // the latest is what people ask for
  const of = (row: number) => entries[row]!;
  const rows = sorted(entries, sort);
  const columns: Column[] = [
    { id: "started", label: COMMON.started, cell: (row) => moment(of(row).started_at) },
    { id: "outcome", label: COMMON.unsuccessful, cell: (row) => HISTORY.counts(badOf(of(row)), of(row).rate.runs) },
    { id: "interval", label: COMMON.interval, cell: (row) => intervalText(of(row).rate.interval) },
    { id: "changed", label: HISTORY.changes, cell: (row) => <span title={of(row).changes.join(", ")}>{of(row).changed}</span> },
    { id: "reason", label: COMMON.reason, cell: (row) => <span title={of(row).reason}>{of(row).reason}</span> },
    { id: "image", label: COMMON.image, cell: (row) => of(row).image },
    { id: "campaign", label: COMMON.campaign, cell: (row) => `${of(row).campaign}/${of(row).name}` },
  ];
  const exported = () => [
    ["campaign", "configuration", "started", "runs", "failed", "errored", "changed", "reason", "image"],
    ...entries.map((one) => [
      one.campaign,
      one.name,
      one.started_at,
      one.rate.runs,
      one.rate.failed,
      one.rate.errored,
      one.changes.join(", "),
      one.reason,
      one.image,
    ]),
  ];
  return (
    <>
      <div class="tools">
        <Export name={`${name}-history`} rows={exported} />
      </div>
      <Grid
        label={HISTORY.grid(name)}
        columns={columns}
        rows={rows}
        sort={sort}
        onSort={setSort}
        open={(row) => (location.hash = configuration(of(row).campaign, of(row).name))}
      />
    </>
  );
}
