// A column of a table, drawn for all runs of a configuration.
import { useEffect, useMemo, useState } from "preact/hooks";
import uPlot from "uplot";
import { address, ask, type Sibling, type Table } from "./api";

import { Plot, type Curve } from "./plot";
import { sortedCurves } from "./tables";
import { OVERLAY } from "./text";

/** Runs that are drawn beside the own one. */
const MOST = 20;
/** Points of each of them. */
const POINTS = 400;

export interface Family {
  campaign: string;
  variant: string;
  run: string;
  siblings: Sibling[];
}

/** The path of a run's table in another run of its configuration; null for a file that is not the run's own. */
export function pathIn({ campaign, variant, run }: Family, path: string, number: number): string | null {
  const own = `${campaign}/${variant}/${run}/`;
  return path.startsWith(own) ? `${campaign}/${variant}/${number}/${path.slice(own.length)}` : null;
}

interface OverlayProps {
  family: Family;
  path: string;
  data: Table;
  over: string;
  drawn: string[];
  start: number | null;
}

/** A plot for each column: passed runs thin, others thick, the own one on top. */
export function Overlay({ family, path, data, over, drawn, start }: OverlayProps) {
  const tables = useTables(family, path, [over, ...drawn]);
  const others = family.siblings.filter(([number]) => String(number) !== family.run);
  const plots = useMemo(
    () => drawn.map((name) => overlaid([...tables, [[-1, "passed", start], data]], over, name)),
    [data, tables, over, drawn.join("\n"), start],
  );
  return (
    <>
      {plots.map(([axis, curves], i) => (
        <figure key={drawn[i]}>
          <figcaption>{drawn[i]}</figcaption>
          <Plot label={OVERLAY.plot(drawn[i]!, curves.length)} x={axis} curves={curves} legend={false} height={200} />
        </figure>
      ))}
      <p class="quiet" role="status">
        {OVERLAY.legend(tables.length, others.length)}
      </p>
    </>
  );
}

/** The table of the other runs, as far as they have it. */
function useTables(family: Family, path: string, columns: string[]): [Sibling, Table][] {
  const [found, setFound] = useState<[Sibling, Table][]>([]);
  useEffect(() => {
    const controller = new AbortController();
    const read = async (sibling: Sibling): Promise<[Sibling, Table][]> => {
      const other = pathIn(family, path, sibling[0])!;
      const table = await ask<Table>(address(["table"], { path: other, column: columns }), controller.signal).catch(() => null);
      return table ? [[sibling, table]] : [];
    };
    const others = family.siblings.filter(([number]) => String(number) !== family.run);
    void Promise.all(others.slice(0, MOST).map(read)).then((tables) => controller.signal.aborted || setFound(tables.flat()));
    return () => controller.abort();
  }, [family.variant, family.run, path, columns.join("\n")]);
  return found;
}

/** One column of several tables over a common axis; the last table is the own one. */
export function overlaid(tables: [Sibling, Table][], over: string, name: string): [Curve, Curve[]] {
  let label = over;
  const columns = tables.map(([[, , start], table]) => {
    const [axis, curves] = sortedCurves(table, over, [name], start);
    label = axis.label;
    const stride = Math.ceil(axis.values.length / POINTS) || 1;
    const thinned = (values: (number | null)[]) => values.filter((_, place) => place % stride === 0);
    return [thinned(axis.values) as number[], thinned(curves[0]!.values)] as uPlot.AlignedData;
  });
  const [axis, ...values] = uPlot.join(columns);
  const curves = values.map((one, i): Curve => {
    const [number, verdict] = tables[i]![0];
    const look = number < 0 ? { colour: "--curve-1", width: 3.5 } : { colour: `--${verdict}`, width: verdict === "passed" ? 1 : 2.2 };
    return { label: number < 0 ? OVERLAY.thisRun : OVERLAY.run(number), values: one as (number | null)[], ...look };
  });
  return [{ label, values: axis as number[] }, curves];
}
