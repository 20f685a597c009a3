// Tables that are still made while one looks at results.

import { usePrepared } from "./live";
import { PREPARING } from "./text";

export function Preparing() {
  const prepared = usePrepared();
  if (!prepared) return null;
  const { done, total, running, changed } = prepared;
  if (running) {
    return (
      <span class="quiet">
        {PREPARING.running(done, total)}
      </span>
    );
  }
  return (
    <>
      {done < total && (
        <span class="quiet">
          {PREPARING.incomplete(done, total)}
        </span>
      )}
      {changed && (
        <button type="button" onClick={() => location.reload()}>
          {PREPARING.show}
        </button>
      )}
    </>
  );
}
