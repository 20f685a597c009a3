// A view's address is the part of the URL behind `#`: a path, and what is chosen in the view.
import { useEffect, useState } from "preact/hooks";

export interface Route {
  path: string[];
  query: URLSearchParams;
}

/** The route that an address stands for. */
export function parse(hash: string): Route {
  const [path = "", query = ""] = hash.replace(/^#\/?/, "").split("?", 2);
  const parts = path.split("/").filter(Boolean).map(decoded);
  return { path: parts, query: new URLSearchParams(query) };
}

/** The address of a view; empty choices are left out. */
export function link(path: (string | number)[], query: Record<string, string> = {}): string {
  const words = new URLSearchParams();
  for (const [key, value] of Object.entries(query)) if (value) words.set(key, value);
  const text = words.toString();
  return "#/" + path.map((part) => encodeURIComponent(String(part))).join("/") + (text && `?${text}`);
}

/** Change what is chosen in this view; an empty choice is removed. `push` makes a step to go back. */
export function choose(changes: Record<string, string>, push = false): void {
  const { path, query } = parse(location.hash);
  for (const [key, value] of Object.entries(changes)) {
    if (value) query.set(key, value);
    else query.delete(key);
  }
  const target = link(path, Object.fromEntries(query));
  if (target === location.hash) return;
  history[push ? "pushState" : "replaceState"](null, "", target);
  dispatchEvent(new HashChangeEvent("hashchange"));
}

/** Names as one choice of an address; a name may have a comma. */
export function joined(names: string[]): string {
  return names.map(encodeURIComponent).join();
}

export function split(text: string): string[] {
  return text.split(",").filter(Boolean).map(decoded);
}

/** The route now, and again whenever it changes. */
export function useRoute(): Route {
  const [route, setRoute] = useState(() => parse(location.hash));
  useEffect(() => {
    const follow = () => setRoute(parse(location.hash));
    addEventListener("hashchange", follow);
    addEventListener("popstate", follow);
    return () => {
      removeEventListener("hashchange", follow);
      removeEventListener("popstate", follow);
    };
  }, []);
  return route;
}

function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
