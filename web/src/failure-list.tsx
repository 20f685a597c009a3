// Why runs did not pass: a line for each cause; a click filters what is shown of the campaign.
import { useMemo, useState } from "preact/hooks";
import type { Columns } from "./api";
import type { Run } from "./data";
import { failures, type Failure } from "./failures";
import { count } from "./format";
import { Glyph } from "./parts";
import { choose } from "./route";
import { CAUSES, COUNTS } from "./text";

/** Causes that are shown at first. */
const FIRST = 8;

interface FailureListProps {
  data: Columns;
  runs: Run[];
  names: string[];
  /** The chosen cause, or nothing. */
  chosen: string;
}

export function FailureList({ data, runs, names, chosen }: FailureListProps) {
  const found = useMemo(() => failures(data, runs, names), [data, runs, names]);
  const [whole, setWhole] = useState(false);
  if (found.length === 0) return null;
  const shown = whole ? found : found.filter((one, place) => place < FIRST || one.cause === chosen);
  const most = found[0]!.runs.length;
  return (
    <section class="failures" aria-labelledby="failures">
      <h2 id="failures">{CAUSES.title}</h2>
      <ul>
        {shown.map((failure) => (
          <Item key={failure.cause} {...{ failure, most }} chosen={failure.cause === chosen} />
        ))}
      </ul>
      {shown.length < found.length && (
        <button type="button" onClick={() => setWhole(true)}>
          {restOf(found.filter((one) => !shown.includes(one)))}
        </button>
      )}
    </section>
  );
}

/** What is not shown yet, by verdict: nothing of it is hidden. */
function restOf(rest: Failure[]): string {
  const verdicts = new Map<string, number>();
  for (const { verdict, runs } of rest) verdicts.set(verdict, (verdicts.get(verdict) ?? 0) + runs.length);
  const runs = [...verdicts].map(([verdict, number]) => COUNTS.of(number, verdict));
  return CAUSES.more(rest.length, runs);
}

function Item({ failure, most, chosen }: { failure: Failure; most: number; chosen: boolean }) {
  const { cause, numbers, verdict, runs, where } = failure;
  return (
    <li>
      <button
        type="button"
        aria-pressed={chosen}
        title={cause}
        onClick={() => choose({ cause: chosen ? "" : cause })}
      >
        <span class={`mark ${verdict}`}>
          <Glyph verdict={verdict} />
          <span class="hidden">{verdict} </span>
        </span>
        <span class="cause">{cause}</span>
        <span class="amount">
          <span class="hidden">, </span>
          {count(runs.length)}
          <span class="hidden"> {CAUSES.run(runs.length)}</span>
        </span>
        <span class={`share ${verdict}`} aria-hidden="true" style={{ width: `${(100 * runs.length) / most}%` }} />
        {numbers && <small>{numbers}</small>}
        {where.length > 0 && <small>{where.join(", ")}</small>}
      </button>
    </li>
  );
}
