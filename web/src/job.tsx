// A job that is being executed: its log as it grows.
import { address, type Columns } from "./api";
import { isStale } from "./campaign";
import { useAnswer } from "./live";
import { Log } from "./log";
import { State, Waiting } from "./parts";
import { link } from "./route";
import { JOB } from "./text";

interface JobProps {
  campaign: string;
  job: string;
  query: URLSearchParams;
}

export function JobPage({ campaign, job, query }: JobProps) {
  const { data, error } = useAnswer<Columns>(address(["campaigns", campaign]), isStale);
  if (!data) return <Waiting error={error} title={job} />;
  const active = data.active.find((one) => one.name === job);
  const log = active?.log ?? `${campaign}/_jobs/${job}/logs/system.log`;
  return (
    <>
      <div class="head">
        <h1>
          {job} {active && <State state="running" />}
        </h1>
        {!active && (
          <p class="hint">
            {JOB.finished} <a href={link(["campaign", campaign])}>{JOB.campaign}</a>
          </p>
        )}
      </div>
      <Log paths={[log]} query={query} period={null} live={Boolean(active)} />
    </>
  );
}
