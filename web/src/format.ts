// Numbers and times as people read them.

export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined) return "–";
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 2 : 1)} s`;
  const whole = Math.round(seconds);
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const pad = (value: number) => String(value).padStart(2, "0");
  return hours ? `${hours} h ${pad(minutes)} min` : `${minutes} min ${pad(rest)} s`;
}

export function moment(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined) return "–";
  const date = new Date(seconds * 1000);
  const pad = (value: number) => String(value).padStart(2, "0");
  const day = `${date.getFullYear()}-${pad(date.getMonth() + 1)}-${pad(date.getDate())}`;
  return `${day} ${pad(date.getHours())}:${pad(date.getMinutes())}:${pad(date.getSeconds())}`;
}

export function bytes(size: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  while (size >= 1000 && unit < units.length - 1) {
    size /= 1000;
    unit += 1;
  }
  return `${unit && size < 100 ? size.toFixed(1) : Math.round(size)} ${units[unit]}`;
}

/** `7.5 %`, `12 %`; only none is `0 %`, and only all `100 %`. As robovast.base.statistics has it. */
export function percent(share: number): string {
  const value = 100 * share;
  if (Math.min(value, 100 - value) < 1e-7) return `${Math.round(value)} %`;
  if (value < 0.05) return "<0.1 %";
  if (value >= 99.95) return ">99.9 %";
  return `${value >= 9.95 && value < 99.5 ? Math.round(value) : value.toFixed(1)} %`;
}

export function count(value: number): string {
  return value.toLocaleString("en").replaceAll(",", "\u202f");
}

export function plural(value: number, noun: string): string {
  return `${count(value)} ${noun}${value === 1 ? "" : "s"}`;
}
