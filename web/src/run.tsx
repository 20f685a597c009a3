// One run: its verdict and why, and all that it left behind.
import type { ComponentChildren } from "preact";
import { useMemo, useRef } from "preact/hooks";
import {
  address,
  fileAddress,
  type FileEntry,
  type Offer,
  type RunAnswer,
  type RunDetails,
  type Sibling,
  type Usage,
} from "./api";
import { show } from "./data";
import { bytes, count, duration, moment } from "./format";
import { Refusal, ReplayText, StartedOn, useStarter } from "./launched";
import { useAnswer, type Versions } from "./live";
import { Bags } from "./bags";
import { HistoryOf } from "./history";
import { Log } from "./log";
import { Notebooks } from "./notebooks";
import { Copy, Export, Folded, Glyph, Mark, Tabs, Waiting, type Tab } from "./parts";
import type { Family } from "./overlay";
import { Player } from "./player/player";
import { Plot } from "./plot";
import { choose, link } from "./route";
import { RunMore } from "./run-more";
import { Tables } from "./tables";

const MOST_SIBLINGS = 50;

interface Target {
  campaign: string;
  variant: string;
  run: string;
}

interface RunProps extends Target {
  query: URLSearchParams;
}

export function RunPage({ campaign, variant, run, query }: RunProps) {
  const isStale = ({ version }: RunAnswer, versions: Versions) => (versions[campaign] ?? version) !== version;
  const { data: answer, error } = useAnswer<RunAnswer>(address(["campaigns", campaign, variant, run]), isStale);
  const data = useUnchanged(answer?.details);
  const siblings = useUnchanged(answer?.siblings);
  if (!answer || !data || !siblings) return <Waiting error={error} title={`${variant}/${run}`} />;
  const { result } = answer;
  const failed = result !== null && result.verdict !== "passed";
  const player = data.recorded.length > 0 && playerOf({ campaign, variant, run }, siblings, query);
  return (
    <>
      <Head data={data} result={result} title={`${variant}/${run}`} target={{ campaign, variant, run }}>
        <RunMore {...{ campaign }} configurations={[variant]} />
      </Head>
      <Siblings {...{ campaign, variant, run, siblings }} />
      <Tabs
        tabs={[...tabsOf(data, failed, { campaign, variant, run, siblings }, query, player), ...(data.on_map ? [mapOf(campaign, variant)] : []), historyOf(campaign, variant), notebooksOf({ campaign, variant, run })]}
        chosen={query.get("tab") ?? "log"}
        onChoose={(tab) => choose({ tab: tab === "log" ? "" : tab })}
      />
    </>
  );
}

/** The same object as long as its content is the same, so that nothing of it is drawn again. */
function useUnchanged<T>(value: T): T {
  const kept = useRef(value);
  if (JSON.stringify(kept.current) !== JSON.stringify(value)) kept.current = value;
  return kept.current;
}

interface SiblingsProps extends Target {
  siblings: Sibling[];
}

/** Links to the other runs of the configuration. */
function Siblings({ campaign, variant, run, siblings }: SiblingsProps) {
  if (siblings.length < 2) return null;
  return (
    <nav class="siblings" aria-label="Runs of this configuration">
      <span aria-hidden="true">Its runs</span>
      {siblings.slice(0, MOST_SIBLINGS).map(([number, verdict]) => (
        <a
          key={number}
          class={`button mark ${verdict}`}
          href={link(["campaign", campaign, variant, number])}
          aria-current={String(number) === run ? "page" : undefined}
        >
          <Glyph verdict={verdict} />
          {number}
          <span class="hidden"> {verdict}</span>
        </a>
      ))}
    </nav>
  );
}

interface HeadProps {
  data: RunDetails;
  result: RunAnswer["result"];
  title: string;
  target: Target;
  /** Of the configuration. */
  children: ComponentChildren;
}

function Head({ data, result, title, target, children }: HeadProps) {
  const { record } = data;
  const text = (key: string) => show(record[key] === "" ? null : record[key]);
  const facts: [string, string][] = [
    ["Started", moment(seconds(record.started_at))],
    ["Duration", duration(record.duration as number | null)],
    ["Exit code", text("exit_code")],
    ["Attempt", text("attempt")],
    ["Seed", text("seed")],
    ...(record.reused_from ? [["Reused from", text("reused_from")] as [string, string]] : []),
    ["Job", text("job")],
    ["Runtime", text("runtime")],
    ["Image", text("image")],
    ["Host", text("host")],
  ];
  return (
    <div class="head">
      <h1>
        {title} {result && <Mark verdict={result.verdict} />}
      </h1>
      {result?.reason && <p class="reason">{result.reason}</p>}
      {data.replay && <ReplayText replay={data.replay} />}
      <Missing files={record.missing} />
      {data.failure && (
        <details>
          <summary>All that the test result says</summary>
          <pre tabIndex={0}>{data.failure}</pre>
        </details>
      )}
      <Folded title="About this run">
        <dl class="facts">
          {facts
            .filter(([, value]) => value !== "–")
            .map(([key, value]) => (
              <div key={key}>
                <dt>{key}</dt>
                <dd>{value}</dd>
              </div>
            ))}
        </dl>
        {data.command && <Repeat command={data.command} target={target} />}
        {children}
      </Folded>
      <StartedOn campaign={target.campaign} />
    </div>
  );
}

/** What the run wrote and could not be stored, as its record says. */
function Missing({ files }: { files: unknown }) {
  const told = Array.isArray(files) ? (files as Partial<Record<string, unknown>>[]) : [];
  return told.length === 0 ? null : (
    <details>
      <summary>Files that could not be stored</summary>
      <ul>
        {told.map((file) => (
          <li key={String(file?.path)}>
            {String(file?.path)}: {String(file?.reason)}
          </li>
        ))}
      </ul>
    </details>
  );
}

/** The command that reproduces the run, and a button that does so. */
function Repeat({ command, target }: { command: string; target: Target }) {
  const { data: offer } = useAnswer<Offer>(address(["offer"]));
  const { start, busy, refusal } = useStarter();
  return (
    <>
      <div class="command">
        <span id="repeat">Run it again here</span>
        <code tabIndex={0} aria-labelledby="repeat">
          {command}
        </code>
        <Copy text={command} label="Copy" />
        {offer?.repeat && (
          <button type="button" disabled={busy} title="Runs it with the same seed, files and image, and compares" onClick={() => start(address(["repeat"], { ...target }))}>
            Run it again
          </button>
        )}
      </div>
      <Refusal text={refusal} />
    </>
  );
}

function seconds(time: unknown): number | null {
  const parsed = typeof time === "string" ? Date.parse(time) / 1000 : NaN;
  return Number.isNaN(parsed) ? null : parsed;
}

function tabsOf(data: RunDetails, failed: boolean, family: Family, query: URLSearchParams, player: Tab | false): Tab[] {
  const all = [...data.files, ...data.job_files];
  const tables = all.filter((file) => file.kind === "table");
  const pictures = all.filter((file) => file.kind === "video" || file.kind === "image");
  const [from, to] = [seconds(data.record.started_at), seconds(data.record.finished_at)];
  const period = from !== null && to !== null ? ([from - 0.002, to + 0.02] as [number, number]) : null;
  const tabs: (Tab | false)[] = [
    { id: "log", label: "Log", show: () => <Log paths={data.logs} {...{ query, period, failed }} start={from} packed={data.packed} /> },
    player,
    tables.length > 0 && { id: "plots", label: "Plots", show: () => <Tables files={tables} query={query} start={from} family={family} /> },
    data.usage.length > 0 && { id: "resources", label: "Resources", show: () => <Resources data={data} /> },
    { id: "parameters", label: "Parameters", show: () => <Parameters data={data} /> },
    pictures.length > 0 && { id: "video", label: pictures.some((file) => file.kind === "video") ? "Video" : "Pictures", show: () => <Pictures files={pictures} /> },
    data.bags.length > 0 && { id: "bag", label: "Bag", show: () => <Bags bags={data.bags} /> },
    { id: "files", label: `Files`, show: () => <Files data={data} /> },
  ];
  return tabs.filter((tab) => tab !== false);
}

function playerOf(target: Target, siblings: Sibling[], query: URLSearchParams): Tab {
  return { id: "player", label: "Player", show: () => <Player {...target} siblings={siblings} query={query} /> };
}

/** The configuration on its map, as it was planned. */
function mapOf(campaign: string, variant: string): Tab {
  const source = address(["map", campaign, variant]);
  const show = () => (
    <figure>
      <img src={source} alt={`Map of ${variant} with start, goals, path and obstacles`} />
      <figcaption>
        Start (S), goals (1, 2, …), shortest path and obstacles, as they were planned.{" "}
        <a href={source} download={`${variant}.svg`}>
          Save SVG
        </a>
      </figcaption>
    </figure>
  );
  return { id: "map", label: "Map", show };
}

function historyOf(campaign: string, variant: string): Tab {
  return { id: "history", label: "History", show: () => <HistoryOf {...{ campaign, variant }} /> };
}

function notebooksOf(target: Target): Tab {
  const { run: _, ...configuration } = target;
  const show = () => (
    <>
      <Notebooks title="For this run" target={target} />
      <Notebooks title="For its configuration" target={configuration} />
    </>
  );
  return { id: "notebooks", label: "Notebooks", show };
}

function Parameters({ data }: { data: RunDetails }) {
  const rows = Object.entries((data.record.parameters ?? {}) as Record<string, unknown>);
  return (
    <>
      {rows.length > 0 ? (
        <>
          <div class="tools">
            <Export name="parameters" rows={() => [["parameter", "value"], ...rows]} />
          </div>
          <Pairs rows={rows} />
        </>
      ) : (
        <p class="hint">No scenario parameter was set.</p>
      )}
      {Object.keys(data.sysinfo).length > 0 && (
        <>
          <h2>Machine</h2>
          <Pairs rows={Object.entries(data.sysinfo).flatMap(flat)} />
        </>
      )}
    </>
  );
}

function flat([key, value]: [string, unknown]): [string, unknown][] {
  const nested = value !== null && typeof value === "object" && !Array.isArray(value);
  return nested ? Object.entries(value) : [[key, value]];
}

function Pairs({ rows }: { rows: [string, unknown][] }) {
  return (
    <table class="plain pairs">
      <tbody>
        {rows.map(([key, value]) => (
          <tr key={key}>
            <th scope="row">{key}</th>
            <td>{show(value)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Resources({ data }: { data: RunDetails }) {
  return (
    <>
      {data.usage.map((path) => (
        <UsageOf key={path} path={path} />
      ))}
    </>
  );
}

function UsageOf({ path }: { path: string }) {
  const { data, error } = useAnswer<Usage>(address(["usage"], { path }));
  const curves = useMemo(() => {
    if (!data) return null;
    const start = data.time[0] ?? 0;
    const x = { label: "time [s]", values: data.time.map((time) => time - start) };
    return {
      x,
      cpu: [{ label: "CPU [%]", values: data.cpu }],
      memory: [{ label: "memory", values: data.memory }],
    };
  }, [data]);
  const name = path.split("/").at(-1)!.replace(/^resource_usage_?|\.csv$/g, "");
  if (!curves) return <Waiting error={error} />;
  if (!curves.x.values.length) return <p class="hint">Nothing was recorded for {name}.</p>;
  return (
    <section>
      <h2>
        Container {name}{" "}
        <a class="button" href={fileAddress(path)} download>
          Save CSV
        </a>
      </h2>
      <Plot label="CPU" {...curves} curves={curves.cpu} format={(v) => `${count(Math.round(v))} %`} fromZero height={180} />
      <Plot label="Memory" {...curves} curves={curves.memory} format={bytes} fromZero height={180} />
    </section>
  );
}

function Pictures({ files }: { files: FileEntry[] }) {
  return (
    <div class="pictures">
      {files.map((file) => (
        <figure key={file.path}>
          {file.kind === "video" ? (
            <video controls preload="metadata" src={fileAddress(file.path)} aria-label={file.name} />
          ) : (
            <img loading="lazy" src={fileAddress(file.path)} alt={file.name} />
          )}
          <figcaption>
            <a href={fileAddress(file.path)} download>
              {file.name}
            </a>
          </figcaption>
        </figure>
      ))}
    </div>
  );
}

function Files({ data }: { data: RunDetails }) {
  return (
    <>
      <FileList title="Run" files={data.files} origins={data.origins} />
      {data.job_files.length > 0 && <FileList title="Job" files={data.job_files} origins={[]} />}
    </>
  );
}

interface FileListProps {
  title: string;
  files: FileEntry[];
  origins: RunDetails["origins"];
}

function FileList({ title, files, origins }: FileListProps) {
  const made = new Map(origins.map((origin) => [origin.path, origin]));
  return (
    <section>
      <h2>{title}</h2>
      <div class="tools">
        <Export name={`files-${title.toLowerCase()}`} rows={() => [["file", "bytes"], ...files.map((file) => [file.name, file.size])]} />
      </div>
      <div class="scroll" tabIndex={0} role="region" aria-label={`Files of the ${title.toLowerCase()}`}>
        <table class="plain">
          <thead>
            <tr>
              <th>File</th>
              <th class="number">Size</th>
              {made.size > 0 && <th>Made by</th>}
              <th>
                <span class="hidden">Open</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {files.map((file) => (
              <tr key={file.path}>
                <td>
                  <a href={fileAddress(file.path)} download>
                    {file.name}
                  </a>
                </td>
                <td class="number">{bytes(file.size)}</td>
                {made.size > 0 && <Made origin={made.get(file.path)} />}
                <td>
                  <Opener file={file} />
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Made({ origin }: { origin: RunDetails["origins"][number] | undefined }) {
  if (!origin) return <td class="quiet">the run</td>;
  return (
    <td>
      {origin.command}
      {origin.sources.length > 0 && <span class="quiet"> from {origin.sources.join(", ")}</span>}
    </td>
  );
}

function Opener({ file }: { file: FileEntry }) {
  const target: Record<string, string> =
    file.kind === "table"
      ? { tab: "plots", table: file.path, columns: "", over: "" }
      : file.kind === "log" || file.kind === "text"
        ? { tab: "", log: file.path }
        : {};
  if (!Object.keys(target).length) return null;
  return (
    <button type="button" onClick={() => choose(target, true)} aria-label={`Show ${file.name}`}>
      Show
    </button>
  );
}
