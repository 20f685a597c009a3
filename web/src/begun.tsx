// The first runs of a campaign, while the server still reads the others.
import { useEffect, useState } from "preact/hooks";
import { address, ask, type Columns } from "./api";
import { CAMPAIGN } from "./text";


/** How long the whole campaign is waited for at first [ms], and how much longer each further time. */
const PAUSE = 150;
const LONGER = 4;

/** What is read of a campaign so far, while all of it is waited for; asked for less and less often. */
export function useBegun(name: string, isWaiting: boolean): Columns | null {
  const [begun, setBegun] = useState<Columns | null>(null);
  useEffect(() => {
    if (!isWaiting) return;
    const controller = new AbortController();
    let pause = PAUSE;
    const look = async () => {
      const found = await ask<Columns | null>(address(["campaigns", name, "begun"]), controller.signal).catch(() => null);
      if (controller.signal.aborted) return;
      if (found) setBegun(found);
      pause *= LONGER;
      timer = setTimeout(look, pause);
    };
    let timer = setTimeout(look, pause);
    return () => {
      controller.abort();
      clearTimeout(timer);
      setBegun(null);
    };
  }, [name, isWaiting]);
  return begun;
}

export function StillReading({ reading: [done, all] }: { reading: [done: number, all: number] }) {
  return (
    <span class="state running" role="status">
      {CAMPAIGN.read(done, all)}
    </span>
  );
}
