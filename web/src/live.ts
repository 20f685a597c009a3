// Versions of all campaigns as the server tells them; every view asks again when its one changes.
import { useEffect, useState } from "preact/hooks";
import { ask, type Launch, type News, type Prepared } from "./api";

/** By campaign; null for one that was removed. */
export type Versions = Record<string, number | null>;

/** Lines that are kept, as many as the server keeps. */
const MOST_LINES = 1000;

const DISMISSED = "dismissed launch";

const listeners = new Set<() => void>();
let versions: Versions = {};
let launched: News | null = null;
/** When the launch was started that is shown no more. */
let dismissed = readDismissed();
let prepared: Prepared | null = null;
let awaited = false;
let source: EventSource | null = null;
let connected = true;

/** Listen while the page is looked at: a browser has few connections to one server. */
export function startListening(): void {
  const follow = () => (document.hidden ? stop() : start());
  document.addEventListener("visibilitychange", follow);
  addEventListener("pagehide", stop);
  follow();
}

function start(): void {
  if (source) return;
  source = new EventSource("api/events");
  source.onmessage = (event) => {
    versions = { ...versions, ...(JSON.parse(event.data) as Versions) };
    connected = true;
    listeners.forEach((tell) => tell());
  };
  source.addEventListener("launch", (event) => {
    launched = joined(launched, JSON.parse(event.data) as News);
    listeners.forEach((tell) => tell());
  });
  source.addEventListener("preparing", (event) => {
    prepared = JSON.parse(event.data) as Prepared;
    awaited ||= prepared.running;
    listeners.forEach((tell) => tell());
  });
  source.onerror = () => {
    connected = false;
    listeners.forEach((tell) => tell());
  };
}

/** Know of what this tab has started before the server tells all of them. */
export function tellLaunch(launch: Launch): void {
  launched = joined(launched, { launch, first: 0, lines: [] });
  listeners.forEach((tell) => tell());
}

/** What was known, continued by news when these follow it. */
export function joined(known: News | null, news: News): News {
  const follows = known?.launch.number === news.launch.number && known.first + known.lines.length === news.first;
  const all = follows ? [...known.lines, ...news.lines] : news.lines;
  const gone = Math.max(0, all.length - MOST_LINES);
  return { launch: news.launch, first: (follows ? known.first : news.first) + gone, lines: all.slice(gone) };
}

function stop(): void {
  source?.close();
  source = null;
}

function useLatest<T>(read: () => T): T {
  const [state, setState] = useState(read);
  useEffect(() => {
    const tell = () => setState(read);
    tell();
    listeners.add(tell);
    return () => void listeners.delete(tell);
  }, []);
  return state;
}

/** Whether the server answers. */
export function useConnected(): boolean {
  return useLatest(() => connected);
}

/** The campaign that was started from here the last time, unless it was dismissed. */
export function useLaunch(): News | null {
  return useLatest(() => (launched && String(launched.launch.started) === dismissed ? null : launched));
}

/** Show what was started from here no more in this tab. */
export function dismissLaunch({ started }: Launch): void {
  dismissed = String(started);
  try {
    sessionStorage.setItem(DISMISSED, dismissed);
  } catch {
    // A browser may refuse to remember.
  }
  listeners.forEach((tell) => tell());
}

function readDismissed(): string {
  try {
    return sessionStorage.getItem(DISMISSED) ?? "";
  } catch {
    return "";
  }
}

/** Tables that are made, or were made since the page was opened. */
export function usePrepared(): Prepared | null {
  return useLatest(() => (awaited ? prepared : null));
}

export interface Answer<T> {
  data: T | null;
  error: string | null;
}

/** Whether an answer is older than what the server has by now. */
export type Stale<T> = (data: T, versions: Versions) => boolean;

/** The last answers, so that a view that one returns to is there at once. */
const remembered = new Map<string, unknown>();
const MOST_REMEMBERED = 6;

function remember(url: string, data: unknown): void {
  remembered.delete(url);
  remembered.set(url, data);
  const [oldest] = remembered.keys();
  if (remembered.size > MOST_REMEMBERED) remembered.delete(oldest!);
}

function recall<T>(url: string | null): Answer<T> {
  return { data: (remembered.get(url ?? "") as T | undefined) ?? null, error: null };
}

/** The answer of the server; asked for again when it is stale. Without a URL nothing is asked. */
export function useAnswer<T>(url: string | null, stale?: Stale<T>): Answer<T> {
  const [answer, setAnswer] = useState<Answer<T> & { url: string | null }>({
    data: null,
    error: null,
    url,
  });
  useEffect(() => {
    if (url === null) return;
    const controller = new AbortController();
    let asking = false;
    let latest: T | null = null;
    const load = async () => {
      asking = true;
      try {
        latest = await ask<T>(url, controller.signal);
        remember(url, latest);
        setAnswer({ data: latest, error: null, url });
      } catch (cause) {
        if (!controller.signal.aborted) setAnswer({ data: null, error: (cause as Error).message, url });
      }
      asking = false;
    };
    const tell = () => {
      if (!asking && latest && stale?.(latest, versions)) void load();
    };
    void load();
    listeners.add(tell);
    return () => {
      controller.abort();
      listeners.delete(tell);
    };
  }, [url]);
  return answer.url === url && (answer.data || answer.error) ? answer : recall(url);
}

export function isRunning(launched: News | null): boolean {
  return launched !== null && launched.launch.ended === null;
}
