// Work that takes seconds runs in a worker: it shows how long it has run, and can be cancelled.

class Jobs {
  constructor({ place, text, cancel }, module, source) {
    Object.assign(this, { place, text, module, source });
    cancel.addEventListener("click", () => this.stop());
  }

  // Call a kernel in the worker; a job that runs is stopped before.
  run(what, name, ...given) {
    this.stop();
    this.worker ??= new Worker(URL.createObjectURL(new Blob([this.source], { type: "text/javascript" })));
    const begin = performance.now();
    const show = () => {
      this.text.textContent = `${what}: ${Math.floor((performance.now() - begin) / 1000)} s`;
    };
    show();
    this.place.hidden = false;
    this.clock = setInterval(show, 1000);
    return new Promise((resolve, reject) => {
      this.reject = reject;
      this.worker.onmessage = ({ data: { found, reason } }) => {
        this.end();
        if (reason === undefined) resolve(found);
        else reject(new Error(reason));
      };
      this.worker.onerror = (event) => this.stop(event.message || "this browser allows the page no worker");
      this.worker.postMessage({ module: this.module, name, given });
    });
  }

  end() {
    clearInterval(this.clock);
    this.place.hidden = true;
    this.reject = null;
  }

  stop(reason = "Cancelled") {
    const { reject } = this;
    if (!reject) return;
    this.worker.terminate();
    this.worker = null;
    this.end();
    reject(new Error(reason));
  }
}
