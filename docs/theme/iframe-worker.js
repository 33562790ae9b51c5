// The search runs in a worker, which pages opened from a folder cannot start. There a hidden frame replaces the
// worker: it loads the same script, and both exchange messages as events.
if (location.protocol === "file:") {
  class FrameWorker extends EventTarget {
    constructor(script) {
      super();
      const waiting = [];
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      const inside = frame.contentWindow;
      this.postMessage = (data) => waiting.push(data);
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      inside.importScripts = (...scripts) => scripts.reduce(
        (before, each) => before.then(() => load(inside.document, each)), Promise.resolve());
      load(inside.document, script).then(() => {
        this.postMessage = (data) => inside.dispatchEvent(new MessageEvent("message", { data }));
        waiting.forEach(this.postMessage);
      });
    }
  }

  function load(page, address) {
    return new Promise((done, failed) => {
      const element = page.createElement("script");
      Object.assign(element, { src: address, onload: done, onerror: failed });
      page.body.append(element);
    });
  }

  window.Worker = window.IFrameWorker = FrameWorker; // the second name is how the search knows where it runs
}
