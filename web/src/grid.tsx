// A table of any length: only the rows in sight are in the document.
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";

const ROW = 34;
const SPARE = 8;

export interface Column {
  id: string;
  label: string;
  kind?: "number" | "text";
  cell: (row: number) => ComponentChildren;
}

/** How far down tables were scrolled, by address and table: one returns to where one was. */
const places = new Map<string, number>();

interface GridProps {
  label: string;
  columns: Column[];
  /** Identities of the rows, in order. */
  rows: number[];
  sort: string;
  onSort: (sort: string) => void;
  open: (row: number) => void;
  /** How many of the first columns stay when the others are scrolled: 1 or 2. */
  frozen?: number;
}

export function Grid({ label, columns, rows, sort, onSort, open, frozen = 0 }: GridProps) {
  const frame = useRef<HTMLDivElement>(null);
  const [top, setTop] = useState(0);
  const [height, setHeight] = useState(600);
  useLayoutEffect(() => {
    const element = frame.current!;
    const observer = new ResizeObserver(() => setHeight(element.clientHeight));
    observer.observe(element);
    element.scrollTop = places.get(location.hash + label) ?? 0;
    return () => observer.disconnect();
  }, []);
  const scrolled = (to: number) => {
    places.set(location.hash + label, to);
    setTop(to);
  };
  const first = Math.max(0, Math.floor(top / ROW) - SPARE);
  const last = Math.min(rows.length, Math.ceil((top + height) / ROW) + SPARE);
  return (
    <div
      class={`grid frozen-${frozen}`}
      ref={frame}
      role="region"
      aria-label={label}
      tabIndex={0}
      onScroll={(event) => scrolled(event.currentTarget.scrollTop)}
      onKeyDown={(event) => moveFocus(event, frame.current!)}
      onMouseOver={sayWhatIsCut}
    >
      <table aria-rowcount={rows.length + 1}>
        <thead>
          <tr aria-rowindex={1}>
            {columns.map((column) => (
              <Head key={column.id} column={column} sort={sort} onSort={onSort} />
            ))}
          </tr>
        </thead>
        <tbody>
          <Space rows={first} columns={columns.length} />
          {rows.slice(first, last).map((row, place) => (
            <tr
              key={row}
              aria-rowindex={first + place + 2}
              data-row={first + place}
              onClick={(event) => openUnlessLink(event, () => open(row))}
            >
              {columns.map((column) => (
                <td key={column.id} class={column.kind === "number" ? "number" : undefined}>
                  {column.cell(row)}
                </td>
              ))}
            </tr>
          ))}
          <Space rows={rows.length - last} columns={columns.length} />
        </tbody>
      </table>
    </div>
  );
}

/** The room that rows out of sight would take. */
function Space({ rows, columns }: { rows: number; columns: number }) {
  if (rows <= 0) return null;
  return (
    <tr aria-hidden="true" class="space">
      <td colSpan={columns} style={{ height: `${rows * ROW}px` }} />
    </tr>
  );
}

function Head({ column, sort, onSort }: { column: Column; sort: string; onSort: (sort: string) => void }) {
  const direction = sort === column.id ? "ascending" : sort === `-${column.id}` ? "descending" : "none";
  return (
    <th aria-sort={direction} class={column.kind === "number" ? "number" : undefined}>
      <button type="button" onClick={() => onSort(direction === "ascending" ? `-${column.id}` : column.id)}>
        {column.label}
        <span aria-hidden="true" class="arrow">
          {{ ascending: "↑", descending: "↓", none: "" }[direction]}
        </span>
      </button>
    </th>
  );
}

function openUnlessLink(event: MouseEvent, open: () => void): void {
  const target = event.target as Element;
  if (!target.closest("a") && !getSelection()?.toString()) open();
}

/** A tooltip for a cell that is too narrow for its text. */
function sayWhatIsCut(event: MouseEvent): void {
  const cell = (event.target as Element).closest("td");
  if (!cell || cell.querySelector("[title]")) return;
  if (cell.scrollWidth > cell.clientWidth) cell.title = cell.textContent ?? "";
  else cell.removeAttribute("title");
}

/** Arrow keys go from row to row. */
function moveFocus(event: KeyboardEvent, frame: HTMLElement): void {
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!step) return;
  event.preventDefault();
  const current = document.activeElement?.closest("tr[data-row]");
  const place = current ? Number(current.getAttribute("data-row")) + step : Math.round(frame.scrollTop / ROW);
  const row = frame.querySelector(`tr[data-row="${place}"]`);
  row?.querySelector("a")?.focus({ preventScroll: true });
  row?.scrollIntoView({ block: "nearest" });
}
