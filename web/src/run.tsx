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
import { COMMON, NOTEBOOKS, RUN } from "./text";

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
    <nav class="siblings" aria-label={RUN.siblings}>
      <span aria-hidden="true">{RUN.itsRuns}</span>
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
    [COMMON.started, moment(seconds(record.started_at))],
    [COMMON.duration, duration(record.duration as number | null)],
    [RUN.exitCode, text("exit_code")],
    [RUN.attempt, text("attempt")],
    [RUN.seed, text("seed")],
    ...(record.reused_from ? [[RUN.reusedFrom, text("reused_from")] as [string, string]] : []),
    [RUN.job, text("job")],
    [RUN.runtime, text("runtime")],
    [COMMON.image, text("image")],
    [RUN.host, text("host")],
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
          <summary>{RUN.testResult}</summary>
          <pre tabIndex={0}>{data.failure}</pre>
        </details>
      )}
      <Folded title={RUN.details}>
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
      <summary>{RUN.missing}</summary>
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
        <span id="repeat">{RUN.reproduceHere}</span>
        <code tabIndex={0} aria-labelledby="repeat">
          {command}
        </code>
        <Copy text={command} />
        {offer?.repeat && (
          <button type="button" disabled={busy} title={RUN.reproduceTitle} onClick={() => start(address(["repeat"], { ...target }))}>
            {RUN.reproduce}
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
    { id: "log", label: RUN.log, show: () => <Log paths={data.logs} {...{ query, period, failed }} start={from} packed={data.packed} /> },
    player,
    tables.length > 0 && { id: "plots", label: RUN.plots, show: () => <Tables files={tables} query={query} start={from} family={family} /> },
    data.usage.length > 0 && { id: "resources", label: RUN.resources, show: () => <Resources data={data} /> },
    { id: "parameters", label: RUN.parameters, show: () => <Parameters data={data} /> },
    pictures.length > 0 && { id: "video", label: pictures.some((file) => file.kind === "video") ? RUN.video : RUN.images, show: () => <Pictures files={pictures} /> },
    data.bags.length > 0 && { id: "bag", label: RUN.bag, show: () => <Bags bags={data.bags} /> },
    { id: "files", label: RUN.files, show: () => <Files data={data} /> },
  ];
  return tabs.filter((tab) => tab !== false);
}

function playerOf(target: Target, siblings: Sibling[], query: URLSearchParams): Tab {
  return { id: "player", label: RUN.playback, show: () => <Player {...target} siblings={siblings} query={query} /> };
}

/** The configuration on its map, as it was planned. */
function mapOf(campaign: string, variant: string): Tab {
  const source = address(["map", campaign, variant]);
  const show = () => (
    <figure>
      <img src={source} alt={RUN.mapOf(variant)} />
      <figcaption>
        {RUN.mapCaption}{" "}
        <a href={source} download={`${variant}.svg`}>
          {RUN.saveSvg}
        </a>
      </figcaption>
    </figure>
  );
  return { id: "map", label: RUN.map, show };
}

function historyOf(campaign: string, variant: string): Tab {
  return { id: "history", label: RUN.history, show: () => <HistoryOf {...{ campaign, variant }} /> };
}

function notebooksOf(target: Target): Tab {
  const { run: _, ...configuration } = target;
  const show = () => (
    <>
      <Notebooks title={NOTEBOOKS.ofRun} target={target} />
      <Notebooks title={NOTEBOOKS.ofConfiguration} target={configuration} />
    </>
  );
  return { id: "notebooks", label: RUN.notebooks, show };
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
        <p class="hint">{RUN.noParameters}</p>
      )}
      {Object.keys(data.sysinfo).length > 0 && (
        <>
          <h2>{RUN.machine}</h2>
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
    const x = { label: RUN.time, values: data.time.map((time) => time - start) };
    return {
      x,
      cpu: [{ label: RUN.cpuInPercent, values: data.cpu }],
      memory: [{ label: RUN.memory, values: data.memory }],
    };
  }, [data]);
  const name = path.split("/").at(-1)!.replace(/^resource_usage_?|\.csv$/g, "");
  if (!curves) return <Waiting error={error} />;
  if (!curves.x.values.length) return <p class="hint">{RUN.noUsage(name)}</p>;
  return (
    <section>
      <h2>
        {RUN.container(name)}{" "}
        <a class="button" href={fileAddress(path)} download>
          {COMMON.saveCsv}
        </a>
      </h2>
      <Plot label={RUN.cpu} {...curves} curves={curves.cpu} format={(v) => `${count(Math.round(v))} %`} fromZero height={180} />
      <Plot label={RUN.memory} {...curves} curves={curves.memory} format={bytes} fromZero height={180} />
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
      <FileList title={RUN.ofRun} files={data.files} origins={data.origins} />
      {data.job_files.length > 0 && <FileList title={RUN.ofJob} files={data.job_files} origins={[]} />}
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
      <div class="scroll" tabIndex={0} role="region" aria-label={RUN.filesOf(title)}>
        <table class="plain">
          <thead>
            <tr>
              <th>{RUN.file}</th>
              <th class="number">{RUN.size}</th>
              {made.size > 0 && <th>{RUN.createdBy}</th>}
              <th>
                <span class="hidden">{RUN.open}</span>
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
  if (!origin) return <td class="quiet">{RUN.theRun}</td>;
  return (
    <td>
      {origin.command}
      {origin.sources.length > 0 && <span class="quiet">{RUN.from(origin.sources)}</span>}
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
    <button type="button" onClick={() => choose(target, true)} aria-label={RUN.showFile(file.name)}>
      {COMMON.show}
    </button>
  );
}
