// Notebooks of a campaign, a configuration or a run: executed when one asks for it.
import { useEffect, useState } from "preact/hooks";
import { address, post, type NotebookEntry, type NotebookResult } from "./api";
import { duration, moment } from "./format";
import { useAnswer } from "./live";
import { Copy, Select, Waiting, type Option } from "./parts";
import { choose } from "./route";
import type { SearchAnswer } from "./search-data";

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
          The .vast file names no notebook for this in <code>evaluation.visualization</code>.
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
      <Notebooks key={batch} title={`For batch ${batch}`} target={{ campaign, batch }} />
      <div class="tools">
        <Select label="Batch" value={batch} options={options} onChoose={(next) => choose({ batch: next })} />
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
    <section class="notebook" aria-label={`Notebook ${workload}`}>
      <h3>
        {workload} <span class="quiet">{entry.path}</span>
      </h3>
      <div class="tools">
        <button type="button" disabled={busy || Boolean(entry.fault)} onClick={() => execute(result ? "1" : "")}>
          {result ? "Execute again" : "Execute"}
        </button>
        <span class="quiet" role="status">
          {busy
            ? "Being executed …"
            : result
              ? `${moment(result.ended)}, took ${duration(result.seconds)}`
              : "Executes code that the campaign brings along."}
        </span>
        <Copy text={entry.command} label="Copy the command that opens it in Jupyter" />
        {result?.has_output && (
          <a class="button" href={shown(result)} target="_blank" rel="noreferrer">
            Alone in a tab
          </a>
        )}
      </div>
      {fault && (
        <p class="error" role="alert">
          {fault}
        </p>
      )}
      {result?.has_output && !busy && (
        <iframe key={result.ended} sandbox="" src={shown(result)} title={`Output of ${workload}`} />
      )}
    </section>
  );
}

function shown(result: NotebookResult): string {
  return `notebooks/${result.key}`;
}
