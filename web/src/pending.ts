// What is being waited for: after a second it is said what that is, and how much of it is there.
import { useEffect, useState } from "preact/hooks";
import { LOADING } from "./text";


export interface Awaited {
  url: string;
  /** When it was asked for [ms]. */
  since: number;
  /** How much of it has come. */
  bytes: number;
}

/** How many configurations of campaigns are read, and of how many; those that are being read. */
export type Reading = Record<string, [done: number, all: number]>;

const PERIOD = 1000;
const awaited = new Set<Awaited>();

/** The answer to a request, which is waited for meanwhile. */
export async function followed(url: string, answer: Promise<Response>): Promise<unknown> {
  const one = { url, since: performance.now(), bytes: 0 };
  awaited.add(one);
  try {
    const { body } = await answer;
    const transform = (part: Uint8Array<ArrayBuffer>, sink: TransformStreamDefaultController) => {
      one.bytes += part.length;
      sink.enqueue(part);
    };
    return await new Response(body!.pipeThrough(new TransformStream({ transform }))).json();
  } finally {
    awaited.delete(one);
  }
}

/** What is waited for by now, in words; nothing in the first second. */
export function useProgress(): string {
  const [said, say] = useState("");
  useEffect(() => {
    const look = async () => {
      const reading = await fetch("api/reading").then((answer) => answer.json() as Promise<Reading>, () => ({}));
      say(progress([...awaited], reading, performance.now()));
    };
    const timer = setInterval(() => void look(), PERIOD);
    return () => clearInterval(timer);
  }, []);
  return said;
}



/** What has been waited for the longest, in words. */
export function progress(awaited: Awaited[], reading: Reading, now: number): string {
  const oldest = awaited.reduce<Awaited | null>((a, b) => (a && a.since <= b.since ? a : b), null);
  if (!oldest) return "";
  const place = oldest.url.replace(/^api\//, "");
  const [, subject = LOADING.otherwise] = LOADING.subjects.find(([pattern]) => pattern.test(place)) ?? [];
  const named = Object.entries(reading).filter(([name]) => place.includes(encodeURIComponent(name)));
  const read = named.map(([name, [done, all]]) => LOADING.read(done, all, name));
  const much = oldest.bytes ? LOADING.soFar(oldest.bytes) : LOADING.seconds((now - oldest.since) / 1000);
  return LOADING.text(subject, read.join(", ") || much);
}
