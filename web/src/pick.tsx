// A choice of one or several of many things, in groups and with a search.
import { useEffect, useRef, useState } from "preact/hooks";
import { grouped, type Option } from "./parts";
import { PICK } from "./text";

interface PickProps {
  /** What is chosen here, and what stands on the button. */
  label: string;
  text: string;
  options: Option[];
  chosen: string[];
  /** Whether there may be several. */
  several?: boolean;
  onChoose: (value: string, isChosen: boolean) => void;
  /** Goes back to the usual choice; there is no button without it. */
  onReset?: () => void;
}

export function Pick({ label, text, options, chosen, several = false, onChoose, onReset }: PickProps) {
  const box = useRef<HTMLDetailsElement>(null);
  const [isOpen, setOpen] = useState(false);
  const close = () => {
    box.current!.open = false;
    box.current!.querySelector("summary")!.focus();
  };
  useEffect(() => {
    if (!isOpen) return;
    const leave = ({ target }: Event) => {
      if (!box.current!.contains(target as Node)) box.current!.open = false;
    };
    addEventListener("pointerdown", leave);
    return () => removeEventListener("pointerdown", leave);
  }, [isOpen]);
  return (
    <details
      class="pick"
      ref={box}
      onToggle={(event) => setOpen(event.currentTarget.open)}
      onKeyDown={(event) => event.key === "Escape" && isOpen && close()}
    >
      <summary>
        {label} <span class="picked">{text}</span>
      </summary>
      {isOpen && (
        <Choices {...{ label, options, chosen, several, onReset }} onChoose={(value, on) => {
          onChoose(value, on);
          if (!several) close();
        }} />
      )}
    </details>
  );
}

function Choices({ label, options, chosen, several, onChoose, onReset }: Omit<PickProps, "text">) {
  const [search, setSearch] = useState("");
  const field = useRef<HTMLInputElement>(null);
  useEffect(() => field.current!.focus(), []);
  const words = search.toLowerCase().split(/\s+/);
  const found = options.filter(([, text, group]) =>
    words.every((word) => `${group ?? ""} ${text}`.toLowerCase().includes(word)),
  );
  return (
    <div class="choices">
      <p>
        <input
          type="search"
          ref={field}
          aria-label={PICK.searchFor(label)}
          placeholder={PICK.search}
          value={search}
          onInput={(event) => setSearch(event.currentTarget.value)}
        />
        {onReset && (
          <button type="button" onClick={onReset}>
            {PICK.reset}
          </button>
        )}
      </p>
      {grouped(found).map(([group, members]) => (
        <fieldset key={group}>
          <legend class={group ? undefined : "hidden"}>{group || label}</legend>
          {members.map(([value, text]) =>
            several ? (
              <label key={value} title={text}>
                <input
                  type="checkbox"
                  checked={chosen.includes(value)}
                  onChange={(event) => onChoose(value, event.currentTarget.checked)}
                />
                <span>{text}</span>
              </label>
            ) : (
              <button key={value} type="button" title={text} aria-pressed={chosen.includes(value)} onClick={() => onChoose(value, true)}>
                {text}
              </button>
            ),
          )}
        </fieldset>
      ))}
      {found.length === 0 && <p class="quiet">{PICK.nothing(search)}</p>}
    </div>
  );
}
