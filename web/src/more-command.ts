// The command that gives configurations of a campaign more runs.

/** Configurations that a command names at most. */
export const MOST_NAMED = 50;
/** Further runs that are offered. */
const FURTHER = 10;

/** So often in all, if nobody says otherwise, where the one with the most has so many. */
export function usualRuns(most: number): number {
  return most + FURTHER;
}

/** Executes configurations of a campaign so often in all; all of them when none is named. */
export function moreRuns(resume: string, configurations: string[], runs: number): string {
  const named = configurations.map((name) => ` --config=${quoted(name)}`);
  return `${resume}${named.join("")} --runs=${runs}`;
}

function quoted(text: string): string {
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`;
}
