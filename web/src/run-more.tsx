// More runs of configurations of a campaign: a command, and a button that executes it.
import { useState } from "preact/hooks";
import { address, type MoreRuns, type Offer } from "./api";

import { Refusal, useStarter } from "./launched";
import { useAnswer, type Versions } from "./live";
import { MOST_NAMED, moreRuns, usualRuns } from "./more-command";
import { Copy } from "./parts";
import { RUN_MORE } from "./text";

interface RunMoreProps {
  campaign: string;
  configurations: string[];
}

export function RunMore({ campaign, configurations }: RunMoreProps) {
  const { data: offer } = useAnswer<Offer>(address(["offer"]));
  const isStale = ({ version }: MoreRuns, versions: Versions) => (versions[campaign] ?? version) !== version;
  const named = configurations.slice(0, MOST_NAMED);
  const { data: more } = useAnswer<MoreRuns>(address(["campaigns", campaign, "more"], { config: named }), isStale);
  const { start, busy, refusal } = useStarter();
  const [wanted, setWanted] = useState(0);
  if (!(more?.command || more?.cluster) || !configurations.length) return null;
  if (configurations.length > MOST_NAMED) {
    return (
      <p class="quiet note">
        {RUN_MORE.tooMany(MOST_NAMED, configurations.length)}
      </p>
    );
  }
  const { planned, cluster } = more;
  const runs = wanted > planned ? wanted : usualRuns(planned);
  const command = cluster
    ? cluster.parts.join(String(cluster.of_all ? runs : runs - planned))
    : moreRuns(more.command, configurations, runs);
  const whose = configurations.length === 1 ? configurations[0]! : RUN_MORE.each(configurations.length);
  return (
    <div class="run-more">
      <label class="choice">
        {RUN_MORE.total(cluster?.of_all ? RUN_MORE.every : whose)}
        <input
          type="number"
          min={planned + 1}
          value={runs}
          onChange={(event) => setWanted(Math.round(Number(event.currentTarget.value)) || 0)}
        />
      </label>
      <div class="command">
        <span id="run-more">{RUN_MORE.label(runs - planned, cluster !== null)}</span>
        <code tabIndex={0} aria-labelledby="run-more">
          {command}
        </code>
        <Copy text={command} />
        {offer?.repeat && !cluster && (
          <button
            type="button"
            disabled={busy}
            title={RUN_MORE.title}
            onClick={() => start(address(["more"], { campaign, config: configurations, runs }))}
          >
            {RUN_MORE.button(runs - planned)}
          </button>
        )}
      </div>
      {cluster && <p class="quiet">{RUN_MORE.name}</p>}
      {more.widen && <p class="quiet">{RUN_MORE.wider}</p>}
      <Refusal text={refusal} />
    </div>
  );
}
