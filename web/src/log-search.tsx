// A text in the logs of all runs, those that did not pass first, cause by cause.
import { useEffect, useState } from "preact/hooks";
import { address, ask, type Columns, type FoundRun } from "./api";
import { variantOf, verdictOf, type Run } from "./data";
import { causeOf, failures } from "./failures";

import { Mark } from "./parts";
import { choose, link } from "./route";
import { COMMON, LOG_SEARCH } from "./text";
import { stamped } from "./times";

/** Runs that the server searches for one answer. */
const STEP = 50;
/** With so many that have the text, no more are searched. */
const ENOUGH = 200;

interface LogSearchProps {
  data: Columns;
  runs: Run[];
  query: URLSearchParams;
}

export function LogSearch({ data, runs, query }: LogSearchProps) {
  const wanted = query.get("text") ?? "";
  const [text, setText] = useState(wanted);
  const ordered = byCause(data, runs);
  const { found, searched, error } = useSearch(data, ordered, wanted);
  const submit = (event: Event) => {
    event.preventDefault();
    choose({ text: text.trim() });
  };
  return (
    <>
      <form class="tools" role="search" onSubmit={submit}>
        <label class="choice">
          {LOG_SEARCH.label}
          <input type="search" value={text} onInput={(event) => setText(event.currentTarget.value)} />
        </label>
        <button type="submit">{LOG_SEARCH.search}</button>
        <span class="quiet" role="status">
          {wanted && LOG_SEARCH.found(found.length, searched, ordered.length)}
        </span>
      </form>
      {error !== null && <p class="error" role="alert">{error}</p>}
      {wanted ? (
        <FoundRuns {...{ data, runs, found }} text={wanted} />
      ) : (
        <p class="hint">{LOG_SEARCH.hint}</p>
      )}
    </>
  );
}

/** Runs of the most frequent cause first, those that passed last. */
function byCause(data: Columns, runs: Run[]): Run[] {
  const failed = failures(data, runs, []).flatMap((failure) => failure.runs);
  return [...failed, ...runs.filter((run) => verdictOf(data, run) === "passed")];
}

function nameOf(data: Columns, run: Run): string {
  return `${variantOf(data, run)}/${data.runs.number[run]}`;
}

/** What is found so far; the runs are asked for step by step. */
function useSearch(data: Columns, runs: Run[], text: string) {
  const [state, setState] = useState<{ found: FoundRun[]; searched: number; error: string | null }>({ found: [], searched: 0, error: null });
  useEffect(() => {
    const controller = new AbortController();
    const search = async () => {
      const found: FoundRun[] = [];
      for (let begin = 0; begin < runs.length && found.length < ENOUGH; begin += STEP) {
        const run = runs.slice(begin, begin + STEP).map((one) => nameOf(data, one));
        found.push(...(await ask<FoundRun[]>(address(["campaigns", data.summary.name, "logs"], { text, run }), controller.signal)));
        setState({ found: [...found], searched: begin + run.length, error: null });
      }
    };
    setState({ found: [], searched: 0, error: null });
    if (text) search().catch((cause: Error) => controller.signal.aborted || setState((known) => ({ ...known, error: cause.message })));
    return () => controller.abort();
  }, [data.summary.name, runs.join(), text]);
  return state;
}

interface FoundRunsProps {
  data: Columns;
  runs: Run[];
  found: FoundRun[];
  text: string;
}

function FoundRuns({ data, runs, found, text }: FoundRunsProps) {
  const place = new Map(runs.map((run) => [nameOf(data, run), run]));
  const groups = new Map<string, FoundRun[]>();
  for (const one of found) {
    const run = place.get(one.run);
    if (run === undefined) continue;
    const title = verdictOf(data, run) === "passed" ? "passed" : causeOf(data, run);
    groups.set(title, [...(groups.get(title) ?? []), one]);
  }
  return (
    <>
      {[...groups].map(([title, members]) => (
        <section key={title}>
          <h2>
            {title} <small>{COMMON.nRuns(members.length)}</small>
          </h2>
          <ul class="found">
            {members.map((one) => (
              <li key={one.run}>
                <a href={logLink(data, one, text)}>{one.run}</a> <Mark verdict={verdictOf(data, place.get(one.run)!)} />{" "}
                <span class="quiet">{COMMON.nLines(one.matches)}</span>
                {one.lines.map(([number, , line]) => (
                  <code key={number}>{stamped(line, 0).text}</code>
                ))}
              </li>
            ))}
          </ul>
        </section>
      ))}
    </>
  );
}

/** The lines in the run's log. */
function logLink(data: Columns, { run, path }: FoundRun, text: string): string {
  const at = run.lastIndexOf("/");
  return link(["campaign", data.summary.name, run.slice(0, at), run.slice(at + 1)], { log: path, find: text });
}
