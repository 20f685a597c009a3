// A log: searched on the server, coloured by level, a page at a time.
import type { TargetedEvent } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { address, ask, fileAddress, type LogPage } from "./api";
import { count } from "./format";
import { Select, Waiting } from "./parts";
import { choose } from "./route";
import { COMMON, LOG } from "./text";
import { stamped } from "./times";

const LEVELS = ["debug", "info", "warn", "error", "fatal"];

interface LogProps {
  paths: string[];
  query: URLSearchParams;
  /** When the run took place [s since the epoch]; its job's log may tell of other runs too. */
  period: [number, number] | null;
  /** When the run started, which times are counted from [s since the epoch]. */
  start?: number | null;
  /** Whether it opens at its first error. */
  failed?: boolean;
  /** Whether it does tell of others. */
  packed?: boolean;
  /** Whether it grows: read again and again, and kept at its end. */
  live?: boolean;
}

/** How often a growing log is read [ms]. */
const PERIOD = 1500;

/** Lines after the first error that are shown at once, where not all can be. */
const AFTER = 1000;

export function Log({ paths, query, period, start = null, failed = false, packed = false, live = false }: LogProps) {
  const path = query.get("log") ?? paths[0] ?? "";
  const text = query.get("find") ?? "";
  const levels = query.get("levels") ?? "";
  const only = (query.get("lines") ?? (packed ? "run" : "all")) === "run" && period;
  const [before, setBefore] = useState(0);
  const [end, setEnd] = useState(0);
  const [page, setPage] = useState<LogPage | null>(null);
  const [error, setError] = useState<string | null>(null);
  const [round, setRound] = useState(0);
  const question = {
    path,
    text,
    levels,
    since: only ? period[0] : undefined,
    until: only ? period[1] : undefined,
  };
  const url = address(["log"], question);
  const [jumps, setJumps] = useState(0);
  const opened = useRef("");
  useEffect(() => setEnd(0), [url]);
  useEffect(() => setBefore(0), [url, end]);
  useEffect(() => {
    if (!live) return;
    const timer = setInterval(() => !document.hidden && setRound((one) => one + 1), PERIOD);
    return () => clearInterval(timer);
  }, [live]);
  useEffect(() => {
    if (!path) return;
    const controller = new AbortController();
    const asked = url + (before ? `&before=${before}` : "") + (end ? `&end=${end}` : "");
    const wait = setTimeout(
      () =>
        ask<LogPage>(asked, controller.signal).then(
          (found) => {
            setPage(found);
            setError(null);
            if (failed && !live && !text && !levels && opened.current !== url) toError(found);
            opened.current = url;
          },
          (cause: Error) => !controller.signal.aborted && setError(cause.message),
        ),
      page ? 300 : 0,
    );
    return () => {
      clearTimeout(wait);
      controller.abort();
    };
  }, [url, before, end, round]);
  const toError = ({ error, lines }: LogPage) => {
    if (error === null) return;
    const isShown = lines.length > 0 && lines[0]![0] <= error && error <= lines.at(-1)![0];
    if (!isShown) setBefore(error + AFTER);
    setJumps((one) => one + 1);
  };
  if (!path) return <p class="hint">{LOG.none}</p>;
  const chosen = new Set(levels.split(",").filter(Boolean));
  const toggle = (level: string) => {
    if (chosen.has(level)) chosen.delete(level);
    else chosen.add(level);
    choose({ levels: [...chosen].join() });
  };
  const options = [...new Set([...paths, path])].map((one): [string, string] => [one, short(one)]);
  return (
    <>
      <div class="tools">
        {options.length > 1 && (
          <Select label={LOG.label} value={path} options={options} onChoose={(log) => choose({ log })} />
        )}
        <label class="choice">
          {LOG.search}
          <input type="search" value={text} onInput={(event) => choose({ find: event.currentTarget.value })} />
        </label>
        <span class="chips" role="group" aria-label={LOG.levels}>
          {LEVELS.filter((level) => page?.counts[level] || chosen.has(level)).map((level) => (
            <button key={level} type="button" class={`level ${level}`} aria-pressed={chosen.has(level)} onClick={() => toggle(level)}>
              {level} {count(page?.counts[level] ?? 0)}
            </button>
          ))}
        </span>
        {period && (
          <label class="choice inline">
            <input
              type="checkbox"
              checked={Boolean(only)}
              onChange={(event) => choose({ lines: event.currentTarget.checked ? "run" : "all" })}
            />
            {LOG.onlyRun}
          </label>
        )}
        <a class="button" href={fileAddress(path)} download>
          {LOG.save}
        </a>
        {page && page.error !== null && !text && !levels && (
          <button type="button" onClick={() => toError(page)}>
            {LOG.firstError}
          </button>
        )}
        <span class="quiet" role="status">
          {page && COMMON.someLines(page.matches, page.total)}
          {page && page.end - page.begin < page.size && LOG.part(page.begin, page.end, page.size)}
        </span>
        {page && page.begin > 0 && (
          <button type="button" onClick={() => setEnd(page.begin)}>
            {LOG.previousPart}
          </button>
        )}
        {end > 0 && (
          <button type="button" onClick={() => setEnd(0)}>
            {LOG.lastPart}
          </button>
        )}
      </div>
      {error !== null || !page ? (
        <Waiting error={error} />
      ) : (
        <Lines {...{ page, text, before, live, start, jumps }} onPage={setBefore} />
      )}
    </>
  );
}



function short(path: string): string {
  return path.split("/").slice(1).join("/");
}

interface LinesProps {
  page: LogPage;
  text: string;
  before: number;
  onPage: (before: number) => void;
  live: boolean;
  start: number | null;
  /** How often one wanted to see the first error. */
  jumps: number;
}

/** Pixels above the line that is jumped to. */
const ABOVE = 70;

/** Attributes of what is scrolled: it stays at its end as it grows, unless one has scrolled up. */
export function useEnd(content: unknown, live = true) {
  const frame = useRef<HTMLDivElement>(null);
  const atEnd = useRef(true);
  useLayoutEffect(() => {
    if (live && atEnd.current && frame.current) frame.current.scrollTop = frame.current.scrollHeight;
  }, [content, live]);
  const onScroll = (event: TargetedEvent<HTMLDivElement>) => {
    const { scrollTop, clientHeight, scrollHeight } = event.currentTarget;
    atEnd.current = scrollTop + clientHeight > scrollHeight - 30;
  };
  return { ref: frame, onScroll };
}

function Lines({ page, text, before, onPage, live, start, jumps }: LinesProps) {
  const end = useEnd(page, live);
  const wanted = useRef<HTMLLIElement>(null);
  const jumped = useRef(0);
  const first = page.lines[0]?.[0] ?? 0;
  useLayoutEffect(() => {
    if (jumped.current === jumps || !wanted.current || !end.ref.current) return;
    jumped.current = jumps;
    end.ref.current.scrollTop = wanted.current.offsetTop - ABOVE;
  }, [page, jumps]);
  if (!page.lines.length) return <p class="hint">{LOG.noMatch}</p>;
  return (
    <div
      class="log"
      {...end}
      tabIndex={0}
      role="region"
      aria-label={LOG.lines}
    >
      {page.lines.length < page.matches && (
        <p class="pager">
          <button type="button" onClick={() => onPage(first)}>
            {LOG.earlier}
          </button>
          {before > 0 && (
            <button type="button" onClick={() => onPage(0)}>
              {LOG.last}
            </button>
          )}
        </p>
      )}
      <ol>
        {page.lines.map(([number, level, line]) => {
          const said = start === null ? { at: "", text: line } : stamped(line, start);
          return (
            <li key={number} value={number} class={level} ref={number === page.error ? wanted : null}>
              <span class="at" aria-hidden="true">
                {number}
              </span>
              {start !== null && <span class="when">{said.at && LOG.at(said.at)}</span>}
              <span class="said">{marked(said.text, text)}</span>
            </li>
          );
        })}
      </ol>
    </div>
  );
}

/** A line with what is searched for marked. */
function marked(line: string, text: string) {
  if (!text) return line;
  const parts = [];
  const [lower, needle] = [line.toLowerCase(), text.toLowerCase()];
  let from = 0;
  for (let at = lower.indexOf(needle); at >= 0; at = lower.indexOf(needle, from)) {
    parts.push(line.slice(from, at), <mark>{line.slice(at, at + text.length)}</mark>);
    from = at + text.length;
  }
  return [...parts, line.slice(from)];
}
