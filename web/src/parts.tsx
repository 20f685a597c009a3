// Parts that several views share.
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { VERDICTS, type CampaignSummary, type Verdict } from "./api";
import { csv } from "./data";
import { count, percent } from "./format";
import { useProgress } from "./pending";
import { COMMON, COUNTS } from "./text";

export const GLYPHS: Record<Verdict, string> = { passed: "✓", failed: "✕", errored: "!", interrupted: "–" };

/** A verdict: colour, sign and word, so that none of them is needed alone. */
export function Mark({ verdict }: { verdict: Verdict }) {
  return (
    <span class={`mark ${verdict}`}>
      <Glyph verdict={verdict} />
      {verdict}
    </span>
  );
}

export function Glyph({ verdict }: { verdict: Verdict }) {
  return (
    <span class="glyph" aria-hidden="true">
      {GLYPHS[verdict]}
    </span>
  );
}

/** Shares of the verdicts of a campaign; what is still to come stays empty. */
export function VerdictBar({ summary }: { summary: CampaignSummary }) {
  const { counts, planned } = summary;
  const shares = VERDICTS.filter((verdict) => counts[verdict] > 0);
  const done = VERDICTS.reduce((sum, verdict) => sum + counts[verdict], 0);
  const text = [...shares.map((verdict) => COUNTS.of(counts[verdict], verdict))];
  const missing = (summary.state === "running" ? COUNTS.pending : COUNTS.notRun)(planned - done);
  if (planned > done) text.push(missing);
  return (
    <div class="verdicts">
      <div class="bar" role="img" aria-label={text.join(", ") || COUNTS.noRuns}>
        {shares.map((verdict) => (
          <span
            key={verdict}
            class={verdict}
            style={{ width: `${(100 * counts[verdict]) / Math.max(1, planned)}%` }}
          />
        ))}
      </div>
      <span class="numbers">
        {shares.map((verdict) => (
          <span key={verdict} class={`mark ${verdict}`} title={verdict}>
            <Glyph verdict={verdict} />
            {count(counts[verdict])}
            <span class="hidden"> {verdict}</span>
          </span>
        ))}
        {planned > done && <span class="quiet">{missing}</span>}
      </span>
    </div>
  );
}

export function State({ state }: { state: CampaignSummary["state"] }) {
  return <span class={`state ${state}`}>{state}</span>;
}

export function passRate(summary: CampaignSummary): string {
  const { passed, failed, errored } = summary.counts;
  const all = passed + failed + errored;
  return all ? percent(passed / all) : "–";
}

interface WaitingProps {
  error: string | null;
  title?: string;
  /** What is said in the first second. */
  what?: string;
}

/** What is shown while an answer is waited for, or instead of it. */
export function Waiting({ error, title, what = COMMON.loading }: WaitingProps) {
  const progress = useProgress();
  return (
    <>
      {title && <h1>{title}</h1>}
      {error === null ? (
        <p class="loading">{progress || what}</p>
      ) : (
        <p class="error" role="alert">
          {error}
        </p>
      )}
    </>
  );
}

/** A text in which code stands between backticks. */
export function Prose({ text }: { text: string }) {
  return <>{text.split("`").map((part, place) => (place % 2 ? <code key={place}>{part}</code> : part))}</>;
}

/** Saves data as a file. */
export function Export({ name, rows }: { name: string; rows: () => unknown[][] }) {
  const save = (text: string, type: string, suffix: string) => {
    const anchor = document.createElement("a");
    anchor.href = URL.createObjectURL(new Blob([text], { type }));
    anchor.download = `${name}.${suffix}`;
    anchor.click();
    setTimeout(() => URL.revokeObjectURL(anchor.href), 10_000);
  };
  const records = () => {
    const [head, ...rest] = rows();
    return rest.map((row) => Object.fromEntries(head!.map((key, place) => [key, row[place]])));
  };
  return (
    <span class="buttons">
      <button type="button" onClick={() => save(csv(rows()), "text/csv", "csv")}>
        {COMMON.saveCsv}
      </button>
      <button
        type="button"
        onClick={() => save(JSON.stringify(records(), null, 1), "application/json", "json")}
      >
        {COMMON.saveJson}
      </button>
    </span>
  );
}

export function Copy({ text, label = COMMON.copy }: { text: string; label?: string }) {
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    await navigator.clipboard.writeText(text);
    setCopied(true);
    setTimeout(() => setCopied(false), 2000);
  };
  return (
    <button type="button" onClick={copy}>
      <span aria-live="polite">{copied ? COMMON.copied : label}</span>
    </button>
  );
}

/** Its value, its text, and the group that it stands in. */
export type Option = [value: string, text: string, group?: string];

interface Choice {
  label: string;
  value: string;
  options: Option[];
  onChoose: (value: string) => void;
}

export function Select({ label, value, options, onChoose }: Choice) {
  return (
    <label class="choice">
      {label}
      <select value={value} onChange={(event) => onChoose(event.currentTarget.value)}>
        {grouped(options).map(([group, members]) => {
          const items = members.map(([key, text]) => (
            <option key={key} value={key}>
              {text}
            </option>
          ));
          return group ? (
            <optgroup key={group} label={group}>
              {items}
            </optgroup>
          ) : (
            items
          );
        })}
      </select>
    </label>
  );
}

/** Options by their group, in their order. */
export function grouped(options: Option[]): [string, Option[]][] {
  const groups = new Map<string, Option[]>();
  for (const option of options) {
    const group = option[2] ?? "";
    groups.set(group, [...(groups.get(group) ?? []), option]);
  }
  return [...groups];
}

export interface Tab {
  id: string;
  label: string;
  show: () => ComponentChildren;
}

const SMALL = "(max-width: 640px)";

/** What is folded away on a small screen. */
export function Folded({ title, children }: { title: string; children: ComponentChildren }) {
  const [isSmall, setSmall] = useState(() => matchMedia(SMALL).matches);
  useEffect(() => {
    const screen = matchMedia(SMALL);
    const follow = () => setSmall(screen.matches);
    screen.addEventListener("change", follow);
    return () => screen.removeEventListener("change", follow);
  }, []);
  if (!isSmall) return <>{children}</>;
  return (
    <details>
      <summary>{title}</summary>
      {children}
    </details>
  );
}

/** From a view's tabs to the first row of the view, or of the page. */
function toRows(event: KeyboardEvent): void {
  const rows = ["#panel tr[data-row] a", "main tr[data-row] a", "#panel [tabindex='0']"];
  const first = rows.map((place) => document.querySelector<HTMLElement>(place)).find(Boolean);
  if (!first) return;
  event.preventDefault();
  first.focus();
}

/** Tabs; arrow keys move between them, and down to the rows. */
export function Tabs({ tabs, chosen, onChoose }: { tabs: Tab[]; chosen: string; onChoose: (id: string) => void }) {
  const current = tabs.find((tab) => tab.id === chosen) ?? tabs[0]!;
  const list = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const tab = list.current!.querySelector<HTMLElement>('[aria-selected="true"]')!;
    const hidden = tab.offsetLeft + tab.offsetWidth - list.current!.clientWidth;
    list.current!.scrollLeft = Math.min(Math.max(list.current!.scrollLeft, hidden), tab.offsetLeft);
  }, [current.id]);
  const move = (event: KeyboardEvent) => {
    if (event.key === "ArrowDown") return toRows(event);
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = tabs[(tabs.indexOf(current) + step + tabs.length) % tabs.length]!;
    onChoose(next.id);
    document.getElementById(`tab-${next.id}`)?.focus();
  };
  return (
    <div class="tabs">
      <div role="tablist" ref={list} onKeyDown={move}>
        {tabs.map((tab) => (
          <button
            key={tab.id}
            id={`tab-${tab.id}`}
            type="button"
            role="tab"
            aria-selected={tab === current}
            aria-controls="panel"
            tabIndex={tab === current ? 0 : -1}
            onClick={() => onChoose(tab.id)}
          >
            {tab.label}
          </button>
        ))}
      </div>
      <section id="panel" role="tabpanel" aria-labelledby={`tab-${current.id}`} key={current.id}>
        {current.show()}
      </section>
    </div>
  );
}
