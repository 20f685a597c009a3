// What a campaign says of itself: its .vast file and its scenario; what changed since another.
import { address, type About, type Change } from "./api";

import { useAnswer } from "./live";
import { Waiting } from "./parts";
import { CHANGES, SOURCES } from "./text";

export function useAbout(campaign: string): About | null {
  return useAnswer<About>(address(["campaigns", campaign, "about"])).data;
}

export function Sources({ about }: { about: About }) {
  if (about.sources.length === 0) return <p class="hint">{SOURCES.none}</p>;
  return (
    <>
      {about.sources.map(({ name, text }) => (
        <section key={name} aria-label={name}>
          <h2>{name}</h2>
          <pre class="source" tabIndex={0} role="region" aria-label={SOURCES.textOf(name)}>
            {text}
          </pre>
        </section>
      ))}
    </>
  );
}



/** The lines that differ between the inputs of two campaigns. */
export function Changes({ a, b }: { a: string; b: string }) {
  const { data, error } = useAnswer<Change[]>(address(["changes"], { a, b }));
  return (
    <section aria-labelledby="changes">
      <h2 id="changes">{CHANGES.title}</h2>
      {!data && <Waiting error={error} />}
      {data?.length === 0 && <p class="quiet">{CHANGES.none}</p>}
      {data?.map((change, place) => (
        <details key={change.name} open={place < OPEN && change.lines.length <= SHORT}>
          <summary>
            {change.name} <span class="quiet">{CHANGES.kinds[change.kind] || tally(change)}</span>
          </summary>
          {change.lines.length > 0 ? <Diff change={change} /> : <p class="quiet">{CHANGES.noText}</p>}
        </details>
      ))}
    </section>
  );
}

/** How many changes are open at first, and how long these may be. */
const OPEN = 4;
const SHORT = 30;

function tally({ lines }: Change): string {
  const starting = (sign: string) => lines.filter((line) => line.startsWith(sign)).length;
  return `+${starting("+")} −${starting("-")}`;
}

function Diff({ change }: { change: Change }) {
  const kind = (line: string) => ({ "+": "ins", "-": "del" })[line[0] ?? ""];
  return (
    <pre class="source" tabIndex={0} role="region" aria-label={CHANGES.linesOf(change.name)}>
      {change.lines.map((line, place) => (
        <span key={place} class={kind(line)}>
          {line}
          {"\n"}
        </span>
      ))}
      {change.more > 0 && CHANGES.moreLines(change.more)}
    </pre>
  );
}
