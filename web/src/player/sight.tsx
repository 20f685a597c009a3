// What a robot's camera saw at a moment.
import { useEffect, useRef } from "preact/hooks";
import { PLAYER } from "../text";
import type { Drive, Sight as Seen } from "./drive";
import type { Picture } from "./stage";

interface SightProps {
  drive: Drive;
  label: string;
  /** Called when the picture can be drawn, and when it is gone. */
  onReady: (picture: Picture, gone: boolean) => void;
}

export function Sight({ drive, label, onReady }: SightProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const screen = new Screen(canvas.current!, drive);
    const picture: Picture = { draw: (time) => void screen.show(Math.min(time, drive.duration)) };
    onReady(picture, false);
    return () => onReady(picture, true);
  }, [drive.key]);
  return <canvas ref={canvas} class="sight" width={320} height={240} role="img" aria-label={label} />;
}

/** Decodes one picture at a time, always the one that is wanted by then. */
class Screen {
  private time = 0;
  private shown: Seen | null = null;
  private busy = false;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly drive: Drive,
  ) {}

  async show(time: number): Promise<void> {
    this.time = time;
    if (this.busy) return;
    this.busy = true;
    for (let sight = this.drive.sightAt(this.time); sight !== this.shown; sight = this.drive.sightAt(this.time)) {
      this.shown = sight;
      if (sight) await this.draw(sight);
      else this.canvas.getContext("2d")!.clearRect(0, 0, this.canvas.width, this.canvas.height);
    }
    this.busy = false;
  }

  private async draw({ picture, time }: Seen): Promise<void> {
    let image: ImageBitmap;
    try {
      image = await createImageBitmap(picture);
    } catch {
      this.drive.remark(PLAYER.damaged(time));
      return;
    }
    this.canvas.width = image.width;
    this.canvas.height = image.height;
    this.canvas.getContext("2d")!.drawImage(image, 0, 0);
    image.close();
  }
}
