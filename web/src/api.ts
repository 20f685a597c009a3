// Asks the server; types of its answers are generated from the Python side.

import type { RunAnswer, Verdict } from "./api-types";
import { followed } from "./pending";
import { SERVER } from "./text";

export * from "./api-types";

export const VERDICTS: Verdict[] = ["passed", "failed", "errored", "interrupted"];

/** A number for each run, `variant/number`. */
export type Metric = Record<string, number>;

/** Number, verdict and start [s since the epoch] of a run of a configuration. */
export type Sibling = RunAnswer["siblings"][number];

type Query = Record<string, string | number | string[] | undefined>;

/** Address of an answer of the server. */
export function address(path: string[], query: Query = {}): string {
  const words = new URLSearchParams();
  for (const [key, value] of Object.entries(query)) {
    for (const one of Array.isArray(value) ? value : [value]) {
      if (one !== undefined && one !== "") words.append(key, String(one));
    }
  }
  const text = words.toString();
  return ["api", ...path.map(encodeURIComponent)].join("/") + (text && `?${text}`);
}

/** Address of a file of the results folder. */
export function fileAddress(path: string): string {
  return "files/" + path.split("/").map(encodeURIComponent).join("/");
}

/** Ask the server; throws an Error whose message is for the user. */
export function ask<T>(url: string, signal?: AbortSignal): Promise<T> {
  return request<T>(url, { signal });
}

/** Ask for files; gives what is said of them, and all of them one after the other. */
export async function askFiles<T>(url: string, signal?: AbortSignal): Promise<[T, Blob]> {
  const whole = await respond(url, { signal });
  const bytes = new Uint8Array(await whole.arrayBuffer());
  const end = bytes.indexOf(10);
  return [JSON.parse(new TextDecoder().decode(bytes.subarray(0, end))) as T, new Blob([bytes.subarray(end + 1)])];
}

/** Ask the server to do something. */
export function post<T>(url: string): Promise<T> {
  return request<T>(url, { method: "POST" });
}

async function request<T>(url: string, options: RequestInit): Promise<T> {
  return (await followed(url, respond(url, options))) as T;
}

async function respond(url: string, options: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(url, options);
  } catch (cause) {
    if (options.signal?.aborted) throw cause;
    throw new Error(SERVER.silent);
  }
  if (!answer.ok) {
    const said = await answer.json().catch(() => null);
    throw new Error(said?.error ?? SERVER.status(answer.status));
  }
  return answer;
}
