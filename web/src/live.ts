// Versions of all campaigns as the server tells them; every view asks again when its one changes.
import { useEffect, useState } from "preact/hooks";
import { ask } from "./api";

export type Versions = Record<string, number>;

const listeners = new Set<() => void>();
let versions: Versions = {};
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
    const next = { ...versions };
    for (const [name, version] of Object.entries(JSON.parse(event.data) as Versions)) {
      if (version === null) delete next[name];
      else next[name] = version;
    }
    versions = next;
    connected = true;
    listeners.forEach((tell) => tell());
  };
  source.onerror = () => {
    connected = false;
    listeners.forEach((tell) => tell());
  };
}

function stop(): void {
  source?.close();
  source = null;
}

/** Whether the server answers. */
export function useConnected(): boolean {
  const [state, setState] = useState(connected);
  useEffect(() => {
    const tell = () => setState(connected);
    listeners.add(tell);
    return () => void listeners.delete(tell);
  }, []);
  return state;
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
