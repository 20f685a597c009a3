import { render } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { News } from "./api";
import { CampaignPage } from "./campaign";
import { CampaignsPage } from "./campaigns";
import { ComparePage } from "./compare";
import { JobPage } from "./job";
import { isRunning, startListening, useConnected, useLaunch } from "./live";
import { Preparing } from "./preparing";
import { link, useRoute } from "./route";
import { RunPage } from "./run";
import { StartPage } from "./start";
import "./style.css";
import { APP, PRODUCT } from "./text";



/** How far down pages were scrolled, by address. */
const places = new Map<string, number>();

function Page() {
  const { path, query } = useRoute();
  const [view, ...names] = path;
  const connected = useConnected();
  const launched = useLaunch();
  const main = useRef<HTMLElement>(null);
  const first = useRef(true);
  useEffect(() => {
    document.title = [...names.toReversed(), APP.titles[view ?? ""], PRODUCT].filter(Boolean).join(" · ");
    if (!first.current) {
      main.current?.focus({ preventScroll: true });
      scrollTo(0, places.get(location.href) ?? 0);
    }
    first.current = false;
  }, [path.join("/")]);
  return (
    <>
      <header class="top">
        <a class="brand" href={link([])}>
          {PRODUCT}
        </a>
        {(view === "campaign" || view === "job") && names[0] && (
          <nav aria-label={APP.breadcrumb}>
            <ol class="place">
              <li>
                <a href={link(["campaign", names[0]])}>{names[0]}</a>
              </li>
              {names[1] && (
                <li aria-current="page">
                  {names.slice(1).join("/")}
                </li>
              )}
            </ol>
          </nav>
        )}
        <span class="news" role="status">
          {!connected && <span class="offline">{APP.offline}</span>}
          {connected && <Preparing />}
          {connected && launched && isRunning(launched) && (
            <a class="state running" href={whereShown(launched)}>
              {APP.running}
            </a>
          )}
        </span>
      </header>
      <main ref={main} tabIndex={-1}>{pageOf(view, names, query)}</main>
    </>
  );
}

/** Where one sees what was started from here. */
function whereShown({ launch: { campaign } }: News): string {
  return link(campaign ? ["campaign", campaign] : ["start"]);
}

function pageOf(view: string | undefined, names: string[], query: URLSearchParams) {
  const [campaign, variant, run] = names;
  if (view === "compare") {
    return <ComparePage before={query.get("a") ?? ""} after={query.get("b") ?? ""} query={query} />;
  }
  if (view === "start") return <StartPage query={query} />;
  if (view === "job" && campaign && variant) {
    return <JobPage campaign={campaign} job={variant} query={query} />;
  }
  if (view === "campaign" && campaign && variant && run) {
    return <RunPage campaign={campaign} variant={variant} run={run} query={query} />;
  }
  if (view === "campaign" && campaign) return <CampaignPage name={campaign} query={query} />;
  if (view === undefined) return <CampaignsPage query={query} />;
  return (
    <>
      <h1>{APP.notFound}</h1>
      <p>
        {APP.incomplete} <a href={link([])}>{APP.allCampaigns}</a>
      </p>
    </>
  );
}

/** `/` goes to the field that finds, as on other pages. */
function find(event: KeyboardEvent): void {
  const { tagName } = event.target as Element;
  if (event.key !== "/" || event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|TEXTAREA|SELECT)$/.test(tagName)) return;
  const field = document.querySelector<HTMLInputElement>("main input[type=search]");
  if (!field) return;
  event.preventDefault();
  field.focus();
}

history.scrollRestoration = "manual";
addEventListener("hashchange", (event) => event.oldURL && places.set(event.oldURL, scrollY));
addEventListener("keydown", find);
startListening();
const root = document.getElementById("page")!;
root.textContent = "";
render(<Page />, root);
