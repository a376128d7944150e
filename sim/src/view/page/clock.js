// The clock of a run that is over: which frame is shown, which is wanted, and how time goes on.

export class Clock {
  /** Frames have `step` and `time_s`; `ask` is told the number of the one that is wanted next. */
  constructor(frames, ask) {
    this.frames = frames;
    this.ask = ask;
    this.speed = 1;
    this.plays = false;
    this.shown = null;
    this.asked = null;
    this.wanted = 0;
    this.time_s = frames[0].time_s;
  }

  get last() { return this.frames.length - 1; }

  /** Goes to a frame, or to the nearest that there is. */
  go(frame) {
    this.wanted = Math.min(Math.max(frame, 0), this.last);
    this.time_s = this.frames[this.wanted].time_s;
    this.send();
  }

  /** Goes to the frame that was written nearest to a step. */
  go_to_step(step) {
    const away = this.frames.map((frame) => Math.abs(frame.step - step));
    this.go(away.indexOf(Math.min(...away)));
  }

  play(on) {
    if (on && this.wanted === this.last) this.go(0);
    this.plays = on;
  }

  /** So much time has passed. */
  tick(ms) {
    if (!this.plays) return;
    this.time_s += (ms / 1000) * this.speed;
    while (this.wanted < this.last && this.frames[this.wanted + 1].time_s <= this.time_s) this.wanted += 1;
    if (this.wanted === this.last) this.plays = false;
    this.send();
  }

  send() {
    if (this.asked !== null || this.wanted === this.shown) return;
    this.asked = this.wanted;
    this.ask(this.wanted);
  }

  /** A frame has come: the one that was asked for, or one that another page wants. */
  came(frame) {
    const is_mine = frame === this.asked;
    this.shown = frame;
    this.asked = null;
    if (is_mine || this.plays) this.send();
    else { this.wanted = frame; this.time_s = this.frames[frame].time_s; }
  }

  /** What was asked for does not come. */
  forget() { this.asked = null; }
}
