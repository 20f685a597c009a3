// The bags of a run: their topics, and when each has messages.
import { address, type Bag, type Timeline } from "./api";
import { show } from "./data";
import { count, duration, moment } from "./format";
import { useAnswer } from "./live";
import { Export } from "./parts";
import { BAGS } from "./text";

const WIDTH = 300;
const HEIGHT = 22;

export function Bags({ bags }: { bags: Bag[] }) {
  return (
    <>
      {bags.map((bag) => (
        <BagOf key={bag.path} bag={bag} />
      ))}
    </>
  );
}

function BagOf({ bag }: { bag: Bag }) {
  const { data, error } = useAnswer<Timeline>(address(["timeline"], { path: bag.path }));
  return (
    <section>
      <h2>{bag.path.split("/").slice(3).join("/")}</h2>
      <p class="quiet">
        {moment(bag.start)}, {duration(bag.duration)}
        {error !== null && BAGS.noTimeline(error)}
      </p>
      <div class="tools">
        <Export name="topics" rows={() => [["topic", "type", "messages"], ...bag.topics]} />
      </div>
      <div class="scroll" tabIndex={0} role="region" aria-label={BAGS.topicsOf(bag.path)}>
        <table class="plain">
          <thead>
            <tr>
              <th>{BAGS.topic}</th>
              <th>{BAGS.type}</th>
              <th class="number">{BAGS.messages}</th>
              <th class="number">{BAGS.perSecond}</th>
              <th>{BAGS.overTime}</th>
            </tr>
          </thead>
          <tbody>
            {bag.topics.map(([name, type, messages]) => (
              <tr key={name}>
                <td>{name}</td>
                <td>{type}</td>
                <td class="number">{count(messages)}</td>
                <td class="number">
                  {bag.duration ? show(Number((messages / bag.duration).toPrecision(3))) : "–"}
                </td>
                <td>
                  <Strip topic={name} counts={data?.topics[name] ?? []} />
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

/** A bar for each part of the time, as high as the part has messages. */
function Strip({ topic, counts }: { topic: string; counts: number[] }) {
  const most = Math.max(...counts, 1);
  const step = WIDTH / Math.max(counts.length, 1);
  const bars = counts.map((messages, part) => {
    const height = messages ? 3 + ((HEIGHT - 3) * messages) / most : 0;
    return messages ? `M${(part * step).toFixed(1)} ${HEIGHT}v${(-height).toFixed(1)}h${step.toFixed(1)}V${HEIGHT}z` : "";
  });
  return (
    <svg class="strip" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={BAGS.messagesOf(topic)}>
      <path d={bars.join("")} />
    </svg>
  );
}
