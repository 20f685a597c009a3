// All texts that a user reads in the web UI, by view. Style and terms: docs/contributing/style.md.
//
// `Prose` shows what stands between backticks as code. Texts of the server, such as reasons and refusals, are in
// src/robovast/evaluation/server.
import { bytes, count, percent, plural } from "./format";

/** The name of the product. */
export const PRODUCT = "RoboVAST";

/** `3 of 10 runs`; without the total where all are shown. */
function some(part: number, whole: number, noun: string): string {
  return part === whole ? plural(whole, noun) : `${count(part)} of ${plural(whole, noun)}`;
}

/** `+4.2` */
function signed(number: string): string {
  return number.startsWith("-") || Number(number) === 0 ? number : `+${number}`;
}

/** `3 of 10 unsuccessful`: failed or errored. */
function unsuccessful(bad: number, runs: number): string {
  return `${bad} of ${runs} unsuccessful`;
}

/** Unit of differences between rates. */
const POINTS = "percentage points";

// ---- In several views

export const COMMON = {
  campaign: "Campaign",
  campaigns: "Campaigns",
  configuration: "Configuration",
  configurations: "Configurations",
  runs: "Runs",
  verdict: "Verdict",
  reason: "Reason",
  started: "Started",
  duration: "Duration",
  durationInSeconds: "duration [s]",
  meanDuration: "mean duration [s]",
  failureRate: "failure rate",
  unsuccessful: "Unsuccessful",
  interval: "95 % interval",
  pValue: "p-value",
  image: "Image",
  filter: "Filter",
  show: "Show",
  loading: "Loading …",
  saveCsv: "Save CSV",
  saveJson: "Save JSON",
  copy: "Copy",
  copied: "Copied",
  onlyCell: "Only the selected cell ✕",
  across: "Across",
  color: "Color",
  allRuns: "All runs",
  mean: (name: string) => `mean ${name}`,
  took: (moment: string, duration: string) => `${moment}, duration ${duration}`,
  nRuns: (runs: number) => plural(runs, "run"),
  nLines: (lines: number) => plural(lines, "line"),
  someRuns: (part: number, all: number) => some(part, all, "run"),
  someLines: (part: number, all: number) => some(part, all, "line"),
  items: (items: number) => plural(items, "item"),
  andMore: (number: number) => `and ${count(number)} more`,
};

/** Groups of parameters, columns and axes in a choice. */
export const GROUPS = {
  run: "Run",
  varied: "Varied",
  derived: "Derived",
  constant: "Constant",
  results: "Results",
};

/** What is left of a campaign's runs, beside its verdicts. */
export const COUNTS = {
  pending: (runs: number) => `${count(runs)} pending`,
  notRun: (runs: number) => `${count(runs)} not run`,
  of: (runs: number, verdict: string) => `${count(runs)} ${verdict}`,
  noRuns: "No runs",
};

export const PICK = {
  search: "Search",
  searchFor: (label: string) => `Search ${label.toLowerCase()}`,
  reset: "Reset",
  nothing: (search: string) => `No matches for “${search}”.`,
};

export const PLOT = {
  label: (name: string, curves: string[], over: string) => `${name}: ${curves.join(", ")} over ${over}`,
};

// ---- The frame of all pages

export const APP = {
  titles: { compare: "Comparison", start: "Run a campaign" } as Record<string, string>,
  breadcrumb: "Breadcrumb",
  offline: "The server does not respond.",
  running: "a campaign is running",
  notFound: "Page not found",
  incomplete: "The address may be incomplete.",
  allCampaigns: "Show all campaigns",
};

export const SERVER = {
  silent: "The server does not respond. Check that `vast evaluation gui` is still running.",
  status: (status: number) => `The server responded with status ${status}.`,
};

export const PREPARING = {
  running: (done: number, total: number) => `Creating tables for plots and colors: ${done} of ${plural(total, "campaign")}`,
  incomplete: (done: number, total: number) =>
    `Tables are available for ${done} of ${plural(total, "campaign")}. See the terminal for errors.`,
  show: "Show new tables",
};

/** What the page is waiting for. */
export const LOADING = {
  /** By the beginning of the address that is asked for; the first that fits. */
  subjects: [
    [/^campaigns$/, "the campaigns"],
    [/^campaigns\/[^/]+$/, "the runs"],
    [/^campaigns\/[^/]+\/factors/, "the effects of factors"],
    [/^campaigns\/[^/]+\/metric\?/, "the values of all runs"],
    [/^campaigns\/[^/]+\/(logs|about|metrics)/, "the files of the campaign"],
    [/^campaigns/, "the run"],
    [/^compar/, "the comparison"],
    [/^changes/, "the changes"],
    [/^search\/[^/]+\/map/, "the failure map"],
    [/^search/, "the search"],
    [/^(maps|failures)/, "the maps"],
    [/^drive/, "the recording"],
    [/^history/, "the history"],
    [/^(log|table|usage|timeline)\?/, "the file"],
  ] as [RegExp, string][],
  otherwise: "the data",
  read: (done: number, all: number, campaign: string) => `${count(done)} of ${count(all)} configurations of ${campaign} read`,
  soFar: (size: number) => `${bytes(size)} so far`,
  seconds: (seconds: number) => `${Math.round(seconds)} s so far`,
  text: (subject: string, progress: string) => `Loading ${subject} … ${progress}`,
};

// ---- Campaigns

export const CAMPAIGNS = {
  title: "Campaigns",
  number: (campaigns: number) => `${plural(campaigns, "campaign")} in`,
  run: "Run a campaign",
  none: "No campaigns yet. Run `vast exec local run` to create one. It appears here immediately.",
  compare: "Compare",
  compareOne: (name: string) => `Compare ${name}`,
  compareWith: (before: string, after: string[]) =>
    `Compare ${before} with ${after.length > 1 ? `${after.length} later campaigns` : after[0]}`,
  hint: "Select two or more campaigns to compare them.",
  list: "List of campaigns",
  state: "State",
  passed: "Passed",
  noMatch: (filter: string) => `No campaign name contains “${filter}”.`,
};

// ---- A campaign

export const CAMPAIGN = {
  details: "Campaign details",
  execution: "Execution",
  version: "RoboVAST version",
  runningNow: "Running jobs:",
  resume: "Resume",
  read: (done: number, all: number) => `${count(done)} of ${count(all)} configurations read`,
  matrix: "Matrix",
  parallel: "Parallel coordinates",
  search: "Search",
  mixed: "Mixed verdicts",
  maps: "Maps",
  logs: "Logs",
  notebooks: "Notebooks",
  sources: "Sources",
  example: (factor: string | undefined) => (factor ? `text, ${factor}=…, duration>2` : "text, duration>2"),
  onlyCause: "Only the selected cause ✕",
  onlyLines: "Only the selected lines ✕",
  verdicts: "Verdicts",
  noMatch: "No run matches the filter.",
  noRuns: "No run has finished yet.",
  unknown: (name: string) => `Unknown parameter or column “${name}”.`,
  similar: "Similar name:",
};

export const COLUMNS = {
  label: "Columns",
  run: "Run",
};

export const SOURCES = {
  none: "The campaign has no .vast file.",
  textOf: (name: string) => `Text of ${name}`,
};

export const MATRIX = {
  label: "Matrix of configurations",
  down: "Down",
  all: "all",
  caption: (measure: string, isCause: boolean, x: string, y: string) => {
    const shown = measure ? `Mean ${measure}` : isCause ? "Rate of runs with the selected cause" : "Rate of unsuccessful runs";
    return `${shown} by ${x || "all"} across and ${y || "all"} down`;
  },
  cell: (where: string, runs: number, bad: number, interval: string) =>
    `${where}: ${plural(runs, "run")}, ${bad} unsuccessful` + (runs ? ` (95 % interval ${interval})` : ""),
  noRuns: "no runs",
  head: (x: string, y: string, measure: string) => [
    ...[y || "all", x || "all", "runs", "unsuccessful", "failure rate", "from", "to"],
    measure && `mean ${measure}`,
  ],
};

export const MEASURE = {
  aggregates: { mean: "mean", least: "minimum", most: "maximum", sum: "sum" } as Record<string, string>,
  perRun: "Per run",
};

export const CAUSES = {
  title: "Causes of unsuccessful runs",
  more: (causes: number, runs: string[]) => `Show ${plural(causes, "more cause")}: ${runs.join(", ")}`,
  run: (runs: number) => (runs === 1 ? "run" : "runs"),
};

export const FACTORS = {
  title: "Effect of factors on failures",
  none: "(all)",
  /** Why these axes were selected; `unclear` are those of them whose effect is not significant. */
  axes: (axes: string[], hasEffects: boolean, unclear: string[]) => {
    const both = axes.join(" and ");
    if (!hasEffects) return `No factor separates failures yet. The axes are the first factors (${both}).`;
    const best = `${both} ${axes.length > 1 ? "separate" : "separates"} failures best`;
    if (unclear.length === 0) return `${best}.`;
    if (unclear.length === axes.length) return `${best}, but not significantly.`;
    return `${best}. The effect of ${unclear[0]} is not significant.`;
  },
  points: (points: number) => `${signed(String(points))} ${POINTS}`,
  interval: (low: number, high: number, p: string) =>
    `95 % interval ${signed(String(low))} to ${signed(String(high))} ${POINTS}, p-value ${p}`,
  rates: (worse: number, better: number) => `${percent(worse)} unsuccessful, ${percent(better)} elsewhere`,
  sure: (low: number, high: number) => `, 95 % interval ${signed(String(low))} to ${signed(String(high))}`,
  unclear: ", not significant",
};

export const MIXED = {
  none: "No configuration has mixed verdicts.",
  label: "Configurations with mixed verdicts",
  strip: unsuccessful,
};

export const PARALLEL = {
  label: "Parallel coordinates",
  axes: "Axes",
  hint: "Drag along an axis to filter configurations. Drag a name, or press ← or →, to move its axis.",
  none: "No axis is selected.",
  chart: (configurations: number, axes: string[]) =>
    `Parallel coordinates of ${plural(configurations, "configuration")} over ${axes.join(", ")}`,
  move: (axis: string) => `${axis}: drag, or press ← or →, to move the axis`,
  rate: (rate: number) => `${percent(rate)} unsuccessful`,
};

export const LOG_SEARCH = {
  label: "Text in the logs",
  search: "Search",
  found: (found: number, searched: number, all: number) =>
    `${plural(found, "matching run")}, ${some(searched, all, "run")} searched`,
  hint: "Searches the logs of the runs that are listed below, unsuccessful runs first. Of a log above 16 MiB, only the last part is searched.",
};

export const MAPS = {
  hint: "Each line approximates the trajectory of a run, from its `poses.csv`. A cross marks the end of an unsuccessful run, a dot the end of a passed run.",
  title: "Configurations by failure rate",
  more: (all: number) => `Show more of ${count(all)} configurations`,
  none: "These configurations have no map and no trajectories.",
  thumbnail: (name: string, rate: number, bad: number, runs: number) => `${name}: ${percent(rate)} unsuccessful, ${bad}/${runs}`,
};

export const FAILURE_MAP = {
  title: "Failure locations",
  more: (maps: number) => `${plural(maps, "more map")} with fewer failures.`,
  map: (failures: number) => `Map with ${plural(failures, "failure")}`,
  runs: "Runs that failed at this location",
  failures: (failures: number, x: number, y: number) => `${plural(failures, "failure")} at ${x.toFixed(1)}, ${y.toFixed(1)}`,
};

export const RUN_MORE = {
  tooMany: (most: number, configurations: number) =>
    `Select at most ${most} configurations to add runs. The selection has ${plural(configurations, "configuration")}.`,
  total: (whose: string) => `Total runs of ${whose}`,
  every: "every configuration",
  each: (configurations: number) => `each of ${plural(configurations, "configuration")}`,
  label: (runs: number, inCluster: boolean) => `Run ${runs} more ${inCluster ? "in the cluster" : "on this machine"}`,
  button: (runs: number) => `Run ${runs} more`,
  title: "Runs code from the campaign on this machine",
  name: "Replace NAME with the name of the Campaign.",
  wider: "Adding runs after you have seen verdicts widens the intervals of all configurations.",
};

// ---- A search

export const SEARCH = {
  finished: (reason: string) => `Finished: ${reason}.`,
  running: "Running.",
  unfinished: "Not finished.",
  evaluated: (sets: number, batches: number, skipped: number) =>
    `${plural(sets, "parameter set")} evaluated in ${count(batches)} ${batches === 1 ? "batch" : "batches"}` +
    (skipped > 0 ? `, ${count(skipped)} skipped.` : "."),
  strategy: "Strategy:",
  version: (version: string | undefined, seed: number) => `${version ? ` (RoboVAST ${version})` : ""}, seed ${seed}.`,
  criteria: "Stopping criteria",
  custom: "The web UI does not run the code of custom strategies. Use `vast results search`.",
  up: "Up",
  width: "interval width",
  certain: "certain",
  uncertain: "uncertain",
  parameters: "Parameters",
  objectives: "Objectives",
  measures: "Measures",
  field: (sets: number, x: string, y: string) => `${plural(sets, "parameter set")} over ${x} and ${y}`,
  keys: "Press arrow keys to select a parameter set, and Enter to open it.",
  dots: "Each dot is a parameter set. Click a dot to open its first run.",
  noScores: "No parameter set has a score yet.",
  /** Of a parameter set: its objective, its batch and what the strategy knew. */
  objective: (name: string, value: string, runs: number) => `${name} ${value} of ${plural(runs, "run")}`,
  batch: (batch: number) => `batch ${batch}`,
  proposed: (strategy: string, version: string, evaluations: number) =>
    `${strategy} ${version}, ${plural(evaluations, "observed evaluation")}`,
  computing: (isFirst: boolean) => (isFirst ? "Computing the map …" : "Computing the map for these values …"),
  lines: (level: number) =>
    `On the solid line, the failure rate is ${percent(level)}. On the dashed line, the lower end of its 95 % interval is ${percent(level)}, and on the dotted line the upper end.`,
  failing: "Failing fraction",
  ofSpace: (low: number, high: number) => ` of the search space (95 % interval ${percent(low)} to ${percent(high)})`,
  misjudged: (wrong: number) => `. The map is expected to be wrong in ${percent(wrong)} of the space.`,
  others: "Other parameters",
  forCritical: "for critical values",
  critical: "Critical values",
  parameter: "Parameter",
  value: "Critical value",
  above: "Above",
  crossing: "Crossing",
  progress: "Progress",
  batches: "batch",
  noBatch: "No batch has scores yet.",
  skipped: (sets: number) => `${plural(sets, "parameter set")} skipped (no score)`,
  more: "Continue the search",
  total: "Total batches",
  command: "Command",
};

// ---- Comparisons

export const COMPARE = {
  title: "Comparison",
  before: "Before",
  after: "After",
  choose: (before: string) => `Select the campaigns to compare with ${before}.`,
  changes: { worse: "▲ worse", better: "▼ better", unclear: "? unclear", same: "= same" },
  counts: (both: number, worse: number, better: number) =>
    `${plural(both, "configuration")} in both campaigns: ${worse} significantly worse, ${better} significantly better.`,
  test: " Each configuration is tested with McNemar’s exact test if its runs have equal seeds, otherwise with Fisher’s exact test. Holm’s correction is applied at the 5 % level.",
  onlyBefore: (number: number) => ` ${plural(number, "configuration")} only in the earlier campaign.`,
  onlyAfter: (number: number) => ` ${plural(number, "configuration")} only in the later campaign.`,
  /** Of `all` configurations only `visible` have runs enough to show any change. */
  power: (all: number, visible: number, least: string, needed: number | null) => {
    if (visible === all) return "";
    const which = visible ? `${all - visible} of the configurations` : "no configuration";
    const correction = all > 1 ? ` before the correction for ${all} configurations` : "";
    const enough = needed === null ? "" : ` At least ${needed} runs of each configuration are needed in each campaign.`;
    return (
      ` With so few runs, ${which} can show ${visible ? "no" : "a"} significant change, not even from 0 % to 100 %.` +
      ` The p-value cannot fall below ${least}${correction}.${enough}`
    );
  },
  detectable: (rise: number) => ` Over all configurations, a rise by ${(100 * rise).toFixed(1)} ${POINTS} is detectable.`,
  byParameter: "Change by parameter",
  measure: `change of the failure rate [${POINTS}]`,
  legend: `Change of the failure rate in ${POINTS}`,
  grid: "Configurations in both campaigns",
  interval: (change: number, low: number, high: number) => {
    const points = (share: number) => (100 * share).toFixed(1);
    return `Difference of ${points(change)} ${POINTS}, 95 % interval ${points(low)} to ${points(high)}`;
  },
  words: { worse: "worse", better: "better", unclear: "unclear", same: "same" },
  noDifference: "no difference",
  change: "Change",
  unsuccessfulBefore: "Unsuccessful before",
  unsuccessfulAfter: "After",
  points: "Percentage points",
  corrected: "Corrected p-value",
  moreRuns: "More runs needed",
  tooMany: "> 100 000",
  medianDuration: "Median duration",
  head: [
    ...["before", "after", "change", "runs before", "unsuccessful before", "runs after", "unsuccessful after"],
    ...["p-value", "corrected p-value", "median duration before", "median duration after"],
  ],
};

export const SEVERAL = {
  points: "Percentage points (95 % interval)",
  worse: "Worse",
  better: "Better",
  unclear: "Unclear",
  insteadOf: (before: string) => `before: ${before}`,
  range: (change: number, low: number, high: number) => {
    const points = (share: number) => signed((100 * share).toFixed(1));
    return `${points(change)} (${points(low)} to ${points(high)})`;
  },
  note: (before: string, campaigns: number, chance: number) =>
    `Each campaign is compared separately with ${before}. Worse and Better count the configurations of both campaigns with a significant change.` +
    ` If no campaign is worse, at least one of ${campaigns} is still reported as worse with a probability of up to ${percent(chance)}.`,
  legend: "Unsuccessful runs: ▲ worse, ▼ better, ? unclear",
  none: (before: string) => `No configuration of ${before} is in the other campaigns.`,
  head: (name: string) => [`unsuccessful ${name}`, `runs ${name}`],
  headOfChange: (name: string) => `change ${name}`,
};

export const CHANGES = {
  title: "Changes",
  none: "No changes. The image, the .vast file, the scenario and all other files are identical.",
  kinds: { changed: "", added: "added", removed: "removed" },
  noText: "The content is not text, or is too long to show.",
  linesOf: (name: string) => `Changed lines of ${name}`,
  moreLines: (lines: number) => `… and ${plural(lines, "more line")}`,
};

export const HISTORY = {
  about: (variant: string, campaigns: number) =>
    `${variant} in ${plural(campaigns, "campaign")}, oldest first. A configuration is recognized by its parameters.`,
  others: (variant: string, campaigns: number) =>
    ` In ${plural(campaigns, "other campaign")}, ${variant} has different parameters.`,
  pending: (campaigns: number) => `Searching ${plural(campaigns, "more campaign")} …`,
  dots: (variant: string) => `${variant} over campaigns`,
  legend: "A dot is filled in proportion to its unsuccessful runs. An empty dot means that all runs passed.",
  changed: (changes: string) => `changed: ${changes}`,
  outcome: unsuccessful,
  counts: (bad: number, runs: number) => `${bad} of ${runs}`,
  changes: "Changed",
  grid: (variant: string) => `${variant} in each campaign`,
};

// ---- A run

export const RUN = {
  siblings: "Runs of this configuration",
  itsRuns: "Runs",
  exitCode: "Exit code",
  attempt: "Attempt",
  seed: "Seed",
  reusedFrom: "Reused from",
  job: "Job",
  runtime: "Runtime",
  host: "Host",
  testResult: "Full test result",
  details: "Run details",
  missing: "Files that could not be stored",
  reproduceHere: "Reproduce on this machine",
  reproduce: "Reproduce",
  reproduceTitle: "Runs again with the same seed, files and image, and compares the results",
  log: "Log",
  plots: "Plots",
  resources: "Resources",
  parameters: "Parameters",
  video: "Video",
  images: "Images",
  bag: "Bag",
  files: "Files",
  playback: "Playback",
  map: "Map",
  history: "History",
  notebooks: "Notebooks",
  mapOf: (variant: string) => `Map of ${variant} with start, goals, path and obstacles`,
  mapCaption: "Planned start (S), goals (1, 2, …), shortest path and obstacles.",
  saveSvg: "Save SVG",
  noParameters: "The run has no scenario parameters.",
  machine: "Machine",
  time: "time [s]",
  cpu: "CPU",
  cpuInPercent: "CPU [%]",
  memory: "Memory",
  noUsage: (container: string) => `No data was recorded for ${container}.`,
  container: (name: string) => `Container ${name}`,
  ofRun: "Run",
  ofJob: "Job",
  filesOf: (title: string) => `Files of the ${title.toLowerCase()}`,
  file: "File",
  size: "Size",
  createdBy: "Created by",
  theRun: "the run",
  from: (sources: string[]) => ` from ${sources.join(", ")}`,
  open: "Open",
  showFile: (name: string) => `Show ${name}`,
};

export const LOG = {
  none: "The run has no log.",
  label: "Log",
  search: "Search",
  levels: "Levels",
  onlyRun: "Only during this run",
  save: "Save log",
  firstError: "First error",
  part: (begin: number, end: number, size: number) =>
    `, ${end < size ? `part ${bytes(begin)} to ${bytes(end)}` : `last ${bytes(end - begin)}`} of ${bytes(size)}`,
  previousPart: "Previous part",
  lastPart: "Last part",
  noMatch: "No line matches.",
  lines: "Lines of the log",
  earlier: "Earlier lines",
  last: "Last lines",
  at: (seconds: string) => `${seconds} s`,
};

export const TABLES = {
  table: "Table",
  allRunsTitle: "Plot the same columns of all runs of this configuration",
  over: "X axis",
  columns: "Columns",
  columnsToPlot: "Columns to plot",
  plot: "Columns of the table",
  size: (rows: number, columns: number, stride: number) =>
    `${plural(rows, "row")}${stride > 1 ? ` (1 of every ${stride} shown)` : ""}, ${plural(columns, "column")}`,
  firstRows: "First rows of the table",
  time: "time since the start [s]",
};

export const OVERLAY = {
  plot: (column: string, runs: number) => `${column} of ${plural(runs, "run")}`,
  legend: (shown: number, others: number) =>
    `This run and ${some(shown, others, "other run")}. This run is the thickest line. Passed runs are thin, unsuccessful runs are thick.`,
  thisRun: "this run",
  run: (number: number) => `run ${number}`,
};

export const BAGS = {
  noTimeline: (error: string) => `. No timeline: ${error}`,
  topicsOf: (path: string) => `Topics of ${path}`,
  topic: "Topic",
  type: "Type",
  messages: "Messages",
  perSecond: "Per second",
  overTime: "Over time",
  messagesOf: (topic: string) => `Messages of ${topic} over time`,
};

export const NOTEBOOKS = {
  ofCampaign: "Notebooks of this campaign",
  ofBatch: (batch: string) => `Notebooks of batch ${batch}`,
  ofRun: "Notebooks of this run",
  ofConfiguration: "Notebooks of this configuration",
  none: "The .vast file has no such notebook in `evaluation.visualization`.",
  batch: "Batch",
  label: (name: string) => `Notebook ${name}`,
  run: "Run notebook",
  runAgain: "Run again",
  running: "Running …",
  warning: "A notebook runs code from the campaign.",
  jupyter: "Copy the Jupyter command",
  newTab: "Open in a new tab",
  output: (name: string) => `Output of ${name}`,
};

export const JOB = {
  finished: "The job has finished.",
  campaign: "Show the campaign",
};

// ---- Playback of a recording

export const PLAYER = {
  label: "Playback",
  allRunsTitle:
    "Show the trajectories of all runs of this configuration, colored by verdict. A cross marks the end of an unsuccessful run.",
  compareWith: "Compare with run",
  none: "none",
  sideBySide: "Side by side",
  map: (names: string[]) => `${names.join(" and ")} on the map`,
  time: "Time",
  timeText: (time: number, duration: number) => `${time.toFixed(1)} of ${duration.toFixed(1)} seconds`,
  pause: "Pause",
  play: "Play",
  speed: "Speed",
  view: "View",
  zoomIn: "Zoom in",
  zoomOut: "Zoom out",
  showAll: "Show all",
  follow: "Follow",
  keys: "Keys",
  keysText: [
    "Space plays and pauses.",
    "← and → move by one second, with Shift by ten seconds.",
    "Comma and full stop move by a tenth of a second.",
    "Home and End move to the start and the end.",
    "+ and − zoom, 0 shows all, and f follows the robot.",
    "[ and ] change the speed.",
    "Drag to move the view.",
    "The mouse wheel zooms if the playback has the focus or if you hold Ctrl.",
  ].join(" "),
  camera: (name: string) => `Camera image of ${name}`,
  damaged: (time: number) => `The camera image at ${time.toFixed(2)} s is damaged.`,
  stoodStill: "The robot never moved more than 5 cm.",
  clock: (at: number, duration: number, isSimulated: boolean) =>
    `${at.toFixed(2)} of ${duration.toFixed(2)} s${isSimulated ? " (simulated time)" : ""}`,
  pose: (x: number, y: number, degrees: number) => ` · x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, ${degrees}°`,
  velocity: (speed: number) => ` · ${speed.toFixed(2)} m/s`,
  oldImage: (time: number) => ` · image from ${time.toFixed(1)} s`,
  oldPose: (age: number) => ` · no pose for ${age.toFixed(1)} s`,
  noPose: " · no pose yet",
  loading: " · loading …",
  scale: (length: number) => `${length} m`,
  /** Number, and where it ended [m], of each run that was unsuccessful. */
  others: (runs: number, ends: [number: string, x: number, y: number][]) => {
    const places = ends.map(([number, x, y]) => `run ${number} at ${x.toFixed(1)}, ${y.toFixed(1)} m`);
    const rest = ends.length > 0 ? `${ends.length} unsuccessful, with ends of ${places.join(" · ")}` : "all passed";
    return `${plural(runs, "other run")} on the map, ${rest}.`;
  },
  missing: "Missing data",
  noEvents: "No log messages or behaviors were recorded.",
  notYet: "No events yet.",
  at: (seconds: number) => `${seconds.toFixed(2)} s`,
};

// ---- Running a campaign

export const START = {
  title: "Run a campaign",
  from: "On this machine, from",
  placeholder: "all, a name, or a pattern such as hall-*",
  runs: "Runs per configuration",
  jobs: "Parallel jobs",
  runtime: "Runtime",
  runtimes: [
    ["", "first available"],
    ["docker", "Docker"],
    ["podman", "Podman"],
    ["process", "local processes (no container)"],
  ] as [string, string][],
  selection: (configurations: number, runs: number) => `${plural(configurations, "configuration")}, ${plural(runs, "run")}`,
  expanding: "Expanding the .vast file …",
  reload: "Reload the .vast file",
  run: "Run",
  busy: "Only one campaign can run at a time.",
  noMatch: "No configuration matches this name.",
  name: "Name",
};

export const LAUNCH = {
  label: "Campaign started here",
  /** By the exit code of the command. */
  outcomes: {
    0: "All runs passed.",
    1: "At least one run failed.",
    2: "An input is invalid.",
    3: "The campaign cannot run on this machine.",
    4: "At least one run is errored or was not started.",
    5: "The results cannot be stored.",
    130: "Stopped.",
  } as Record<number, string>,
  /** The same of a run that is reproduced. */
  reproduced: {
    0: "The verdict was reproduced.",
    1: "The run had another result.",
  } as Record<number, string>,
  failed: (code: number | null) => `The command failed (exit code ${code}).`,
  running: "Running.",
  stopping: "Stopping after the running scenarios.",
  postprocessing: "All runs have finished. The results are being postprocessed.",
  title: "Campaign",
  again: (run: string) => `Re-run of ${run}`,
  further: "Additional runs",
  stop: "Stop",
  stopNow: "Stop immediately",
  showRun: "Show the run",
  showRuns: "Show the runs",
  dismiss: "Dismiss",
  comparison: "Comparison with the original",
  replayOf: "Re-run of",
  notCompared: ", not compared with the original.",
  output: "Output",
};
