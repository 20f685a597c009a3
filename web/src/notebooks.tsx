// Notebooks of a campaign, a configuration or a run: executed when one asks for it.
import { useEffect, useState } from "preact/hooks";
import { address, post, type NotebookEntry, type NotebookResult } from "./api";
import { duration, moment } from "./format";
import { useAnswer } from "./live";
import { Copy, Prose, Select, Waiting, type Option } from "./parts";
import { choose } from "./route";
import type { SearchAnswer } from "./search-data";
import { COMMON, NOTEBOOKS } from "./text";

interface Target {
  campaign: string;
  batch?: string;
  variant?: string;
  run?: string;
}

/** The notebooks for a target, each with its output below. */
export function Notebooks({ title, target }: { title: string; target: Target }) {
  const { data, error } = useAnswer<NotebookEntry[]>(address(["notebooks"], { ...target }));
  return (
    <>
      <h2>{title}</h2>
      {!data && <Waiting error={error} />}
      {data?.length === 0 && (
        <p class="hint">
          <Prose text={NOTEBOOKS.none} />
        </p>
      )}
      {data?.map((entry) => <Workload key={entry.workload} entry={entry} target={target} />)}
    </>
  );
}

/** The notebooks for a batch of a search: the last one that is scored, unless one is chosen. */
export function BatchNotebooks({ campaign, chosen }: { campaign: string; chosen: string | null }) {
  const { data } = useAnswer<SearchAnswer>(address(["search", campaign]));
  if (!data || data.batches === 0) return null;
  const options = Array.from({ length: data.batches }, (_, batch): Option => [String(batch), String(batch)]);
  const batch = options.some(([value]) => value === chosen) ? chosen! : String(data.batches - 1);
  return (
    <>
      <Notebooks key={batch} title={NOTEBOOKS.ofBatch(batch)} target={{ campaign, batch }} />
      <div class="tools">
        <Select label={NOTEBOOKS.batch} value={batch} options={options} onChoose={(next) => choose({ batch: next })} />
      </div>
    </>
  );
}

function Workload({ entry, target }: { entry: NotebookEntry; target: Target }) {
  const { workload } = entry;
  const [latest, setLatest] = useState<NotebookResult | null>(null);
  const [busy, setBusy] = useState(false);
  const [refusal, setRefusal] = useState("");
  const result = latest ?? entry.result ?? null;
  const fault = entry.fault || refusal || (busy ? "" : result?.fault);
  const execute = async (again: string) => {
    setBusy(true);
    setRefusal("");
    try {
      setLatest(await post<NotebookResult>(address(["notebook"], { ...target, workload, again })));
    } catch (cause) {
      setRefusal((cause as Error).message);
    }
    setBusy(false);
  };
  useEffect(() => {
    if (entry.running) void execute("");
  }, [entry.running]);
  return (
    <section class="notebook" aria-label={NOTEBOOKS.label(workload)}>
      <h3>
        {workload} <span class="quiet">{entry.path}</span>
      </h3>
      <div class="tools">
        <button type="button" disabled={busy || Boolean(entry.fault)} onClick={() => execute(result ? "1" : "")}>
          {result ? NOTEBOOKS.runAgain : NOTEBOOKS.run}
        </button>
        <span class="quiet" role="status">
          {busy
            ? NOTEBOOKS.running
            : result
              ? COMMON.took(moment(result.ended), duration(result.seconds))
              : NOTEBOOKS.warning}
        </span>
        <Copy text={entry.command} label={NOTEBOOKS.jupyter} />
        {result?.has_output && (
          <a class="button" href={shown(result)} target="_blank" rel="noreferrer">
            {NOTEBOOKS.newTab}
          </a>
        )}
      </div>
      {fault && (
        <p class="error" role="alert">
          {fault}
        </p>
      )}
      {result?.has_output && !busy && (
        <iframe key={result.ended} sandbox="" src={shown(result)} title={NOTEBOOKS.output(workload)} />
      )}
    </section>
  );
}

function shown(result: NotebookResult): string {
  return `notebooks/${result.key}`;
}
