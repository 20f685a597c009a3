// What the server answers; the names are those of the Python side.

import { followed } from "./pending";
import { SERVER } from "./text";

export type Verdict = "passed" | "failed" | "errored" | "interrupted";
export const VERDICTS: Verdict[] = ["passed", "failed", "errored", "interrupted"];

export interface Summary {
  name: string;
  state: "running" | "finished" | "incomplete";
  planned: number;
  counts: Record<Verdict, number>;
  variants: number;
  started_at: number | null;
  duration: number | null;
  execution: Record<string, unknown>;
  version: number;
}

export interface Campaigns {
  results: string;
  campaigns: Record<string, Summary | null>;
  /** Why campaigns cannot be read. */
  faults: Record<string, string>;
}

export interface ActiveJob {
  name: string;
  log: string | null;
}

export interface Columns {
  summary: Summary;
  /** How many configurations are read so far, and of how many; null when all are. */
  reading: [done: number, all: number] | null;
  active: ActiveJob[];
  /** Whether it is a search that has proposed something. */
  search: boolean;
  /** Command that executes what is missing; empty when there is none. */
  resume: string;
  /** Why intervals are wider than those of a fixed number of runs; empty if they are not. */
  wider: string;
  verdicts: Verdict[];
  /** Decision of the campaign's test about each configuration, for example `passing after 18`; empty without one. */
  decided: string[];
  reasons: string[];
  /** What reasons have in common, and for each reason its place in that. */
  causes: string[];
  /** By cause: the ranges of the numbers in which its reasons differ. */
  numbers: string[];
  cause: number[];
  /** Values of factors, then of the other parameters. */
  variants: { name: string[]; entry: string[]; values: Record<string, unknown[]> };
  /** What a person varied; the parameters where nothing else is stated. */
  factors: string[];
  /** Of the factors that have one. */
  units: Record<string, string>;
  runs: {
    variant: number[];
    number: number[];
    verdict: number[];
    reason: number[];
    started: (number | null)[];
    duration: (number | null)[];
  };
}

/** Runs of the configurations on one side of a split by a factor. */
export interface Side {
  condition: string;
  bad: number;
  runs: number;
}

/** How much more often the runs of some values of a factor fail. */
export interface Effect {
  factor: string;
  worse: Side;
  better: Side;
  low: number;
  high: number;
  p: number;
  same: string[];
}

/** What a campaign says of itself; its sources are the .vast file and the scenario. */
export interface About {
  title: string;
  description: string;
  sources: { name: string; text: string }[];
}

/** A file, or a circumstance, that differs between two campaigns. */
export interface Change {
  name: string;
  kind: "changed" | "added" | "removed";
  lines: string[];
  /** Lines that are left out. */
  more: number;
}

/** The factors of a campaign, and which of them separate failures. */
export interface Explained {
  version: number;
  factors: string[];
  same: Record<string, string[]>;
  effects: Effect[];
  axes: string[];
}

/** Columns with numbers, by table, and those of them that have one value everywhere. */
export interface Metrics {
  columns: Record<string, string[]>;
  same: Record<string, string[]>;
}

/** A number for each run, `variant/number`. */
export type Metric = Record<string, number>;

export interface FileEntry {
  path: string;
  name: string;
  kind: "table" | "log" | "text" | "image" | "video" | "other";
  size: number;
}

export interface Bag {
  path: string;
  start: number;
  duration: number;
  topics: [string, string, number][];
}

/** Number, verdict and start [s since the epoch] of a run of a configuration. */
export type Sibling = [number, Verdict, number | null];

/** A run, and all runs of its configuration. */
export interface RunAnswer {
  /** Of the campaign. */
  version: number;
  details: RunDetails;
  siblings: Sibling[];
  /** Null while the run is not in the list yet. */
  result: { verdict: Verdict; reason: string } | null;
}

/** Messages over time, in equal parts. */
export interface Timeline {
  start: number;
  end: number;
  topics: Record<string, number[]>;
}

export interface RunDetails {
  record: Record<string, unknown>;
  files: FileEntry[];
  job_files: FileEntry[];
  packed: boolean;
  logs: string[];
  usage: string[];
  sysinfo: Record<string, unknown>;
  bags: Bag[];
  /** Folders of bags, also of recorders that were killed. */
  recorded: string[];
  origins: { path: string; command: string; sources: string[] }[];
  command: string;
  on_map: boolean;
  failure: string;
  /** If the run is a replay: how it compares with the run that it repeats. */
  replay: Replay | null;
}

export interface Replay {
  /** The run that it repeats, `campaign/variant/number`. */
  of: string;
  /** Whether that run is in the results folder. */
  stored: boolean;
  /** Null if they were not compared. */
  same: boolean | null;
  text: string;
}

export interface LogPage {
  lines: [number, string, string][];
  matches: number;
  total: number;
  counts: Record<string, number>;
  /** Number of the first error, whatever was searched for. */
  error: number | null;
  /** Which part of the file they are of [bytes]. */
  begin: number;
  end: number;
  size: number;
}

export interface Table {
  names: string[];
  columns: Record<string, (number | string | null)[]>;
  rows: number;
  stride: number;
}

export interface Usage {
  time: number[];
  cpu: number[];
  memory: number[];
}

export interface Sample {
  runs: number;
  bad: number;
  duration: number | null;
}

export interface Difference {
  a: Sample;
  b: Sample;
  p: number;
  low: number;
  high: number;
}

export interface Comparison {
  overall: Difference;
  statement: string;
  /** What so many runs can show at all. */
  least_p: number;
  visible: number;
  needed_runs: number | null;
  detectable: number | null;
  variants: {
    name_a: string;
    name_b: string;
    difference: Difference;
    adjusted_p: number;
    change: "worse" | "better" | "unclear" | "same";
    more_runs: number | null;
  }[];
  only_a: string[];
  only_b: string[];
}

/** A campaign beside an earlier one. */
export interface Compared {
  name: string;
  comparison: Comparison;
}

/** What can be run from here. */
export interface Offer {
  document: string | null;
  runs: number;
  /** Why no campaign can be started. */
  refusal: string;
  /** Whether a run can be executed again. */
  repeat: boolean;
}

/** A campaign that was started from here. */
export interface Launch {
  number: number;
  command: string;
  /** The campaign on whose page it was started; empty for one of the document. */
  campaign: string;
  /** The campaign whose runs it executes; empty until it exists. */
  makes: string;
  /** If it reproduces a run: `variant/number`. */
  run: string;
  started: number;
  ended: number | null;
  code: number | null;
  stopping: boolean;
  /** Why it failed, if it reported an error. */
  error: string;
}

export interface NotebookResult {
  key: string;
  /** What went wrong, and in which cell. */
  fault: string;
  seconds: number;
  ended: number;
  has_output: boolean;
}

export interface NotebookEntry {
  workload: string;
  path: string;
  /** Opens it in Jupyter. */
  command: string;
  fault?: string;
  running?: boolean;
  result?: NotebookResult | null;
}

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
