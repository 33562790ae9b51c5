// Shows running tasks with their progress and elapsed time.
export class Activities {
  constructor(box) {
    this.box = box;
    this.rows = [];
    setInterval(() => this.write(), 1000);
  }

  show(rows) {
    const now = performance.now() / 1000;
    this.rows = rows.map(row => ({ ...row, since: now - row.seconds }));
    while (this.box.children.length > rows.length) this.box.lastChild.remove();
    while (this.box.children.length < rows.length) this.box.append(made());
    this.write();
  }

  write() {
    this.rows.forEach((row, i) => {
      const [title, step, bar] = this.box.children[i].children;
      const words = `Preparing ${row.title}`;
      if (title.textContent !== words) title.textContent = words;
      const seconds = Math.max(0, Math.floor(performance.now() / 1000 - row.since));
      step.textContent = `${described(row)} · ${seconds} s`;
      if (row.about) { bar.max = row.about; bar.value = row.done; }
      else bar.removeAttribute("value");
    });
  }
}

function described({ step, done, about }) {
  if (!done) return step;
  return about ? `${step} kernel ${done} of about ${about}` : `${step} kernel ${done}`;
}

function made() {
  const box = document.createElement("div");
  box.className = "activity";
  box.innerHTML = `<div class="title"></div><div class="step" aria-hidden="true"></div><progress aria-label="progress"></progress>
    <p class="hint">A first start compiles for about a minute. Later starts find the kernels on the disk.</p>`;
  return box;
}
