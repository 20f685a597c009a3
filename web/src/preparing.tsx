// Tables that are still made while one looks at results.
import { plural } from "./format";
import { usePrepared } from "./live";

export function Preparing() {
  const prepared = usePrepared();
  if (!prepared) return null;
  const { done, total, running, changed } = prepared;
  if (running) {
    return (
      <span class="quiet">
        Tables are being made, for plots and colours: {done} of {plural(total, "campaign")}
      </span>
    );
  }
  return (
    <>
      {done < total && (
        <span class="quiet">
          Tables of {done} of {plural(total, "campaign")} could be made; the terminal says why.
        </span>
      )}
      {changed && (
        <button type="button" onClick={() => location.reload()}>
          Tables were made: show them
        </button>
      )}
    </>
  );
}
