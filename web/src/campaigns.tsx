// All campaigns of the results folder.
import { useState } from "preact/hooks";
import { address, VERDICTS, type Campaigns, type CampaignSummary } from "./api";
import { duration, moment } from "./format";
import { useAnswer, type Versions } from "./live";
import { Export, passRate, Prose, State, VerdictBar, Waiting } from "./parts";
import { choose, joined, link } from "./route";
import { CAMPAIGNS, COMMON } from "./text";

export function isStale(data: Campaigns, versions: Versions): boolean {
  const names = new Set([...Object.keys(versions), ...Object.keys(data.campaigns)]);
  return [...names].some(
    (name) => !data.faults[name] && (versions[name] ?? undefined) !== data.campaigns[name]?.version,
  );
}

export function CampaignsPage({ query }: { query: URLSearchParams }) {
  const { data, error } = useAnswer<Campaigns>(address(["campaigns"]), isStale);
  const [chosen, setChosen] = useState<string[]>([]);
  const filter = query.get("q") ?? "";
  if (!data) return <Waiting error={error} title={CAMPAIGNS.title} />;
  const all = Object.entries(data.campaigns);
  const shown = all.filter(([name]) => name.toLowerCase().includes(filter.toLowerCase()));
  const toggle = (name: string) =>
    setChosen(chosen.includes(name) ? chosen.filter((one) => one !== name) : [...chosen, name]);
  // The oldest campaign is what the newer ones are compared with.
  const [before, ...after] = all.map(([name]) => name).filter((name) => chosen.includes(name)).reverse();
  return (
    <>
      <div class="head">
        <h1>{CAMPAIGNS.title}</h1>
        <p class="tools">
          <span class="quiet">
            {CAMPAIGNS.number(all.length)} <code>{data.results}</code>
          </span>
          <a class="button" href={link(["start"])}>
            {CAMPAIGNS.run}
          </a>
        </p>
      </div>
      {all.length === 0 && (
        <p class="hint">
          <Prose text={CAMPAIGNS.none} />
        </p>
      )}
      {all.length > 0 && (
        <>
          <div class="tools">
            <label class="choice">
              {COMMON.filter}
              <input
                type="search"
                value={filter}
                onInput={(event) => choose({ q: event.currentTarget.value })}
              />
            </label>
            {before && after.length > 0 ? (
              <a class="button" href={link(["compare"], { a: before, b: joined(after) })}>
                {CAMPAIGNS.compareWith(before, after)}
              </a>
            ) : (
              <span class="quiet">{CAMPAIGNS.hint}</span>
            )}
            <Export name="campaigns" rows={() => exported(shown)} />
          </div>
          <div class="scroll" tabIndex={0} role="region" aria-label={CAMPAIGNS.list}>
            <table class="list">
              <thead>
                <tr>
                  <th>
                    <span class="hidden">{CAMPAIGNS.compare}</span>
                  </th>
                  <th>{COMMON.campaign}</th>
                  <th>{CAMPAIGNS.state}</th>
                  <th class="wide">{COMMON.runs}</th>
                  <th class="number">{CAMPAIGNS.passed}</th>
                  <th>{COMMON.started}</th>
                  <th class="number">{COMMON.duration}</th>
                </tr>
              </thead>
              <tbody>
                {shown.map(([name, summary]) => (
                  <Row
                    key={name}
                    name={name}
                    summary={summary}
                    fault={data.faults[name]}
                    chosen={chosen.includes(name)}
                    onToggle={() => toggle(name)}
                  />
                ))}
              </tbody>
            </table>
          </div>
          {shown.length === 0 && <p class="hint">{CAMPAIGNS.noMatch(filter)}</p>}
        </>
      )}
    </>
  );
}

function exported(shown: [string, CampaignSummary | null][]): unknown[][] {
  const line = ([name, summary]: [string, CampaignSummary | null]) => [
    name,
    summary?.state,
    summary?.planned,
    ...VERDICTS.map((verdict) => summary?.counts[verdict]),
    moment(summary?.started_at),
    summary?.duration,
  ];
  return [["campaign", "state", "planned", ...VERDICTS, "started", "duration"], ...shown.map(line)];
}

interface RowProps {
  name: string;
  summary: CampaignSummary | null;
  fault: string | undefined;
  chosen: boolean;
  onToggle: () => void;
}

function Row({ name, summary, fault, chosen, onToggle }: RowProps) {
  return (
    <tr>
      <td>
        <input type="checkbox" checked={chosen} onChange={onToggle} aria-label={CAMPAIGNS.compareOne(name)} />
      </td>
      <td>
        <a href={link(["campaign", name])}>{name}</a>
      </td>
      {summary && !fault ? (
        <>
          <td>
            <State state={summary.state} />
          </td>
          <td>
            <VerdictBar summary={summary} />
          </td>
          <td class="number">{passRate(summary)}</td>
          <td class="nowrap">{moment(summary.started_at)}</td>
          <td class="number nowrap">{duration(summary.duration)}</td>
        </>
      ) : (
        <td colSpan={5} class="quiet">
          {fault ?? COMMON.loading}
        </td>
      )}
    </tr>
  );
}
