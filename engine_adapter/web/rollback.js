// Rollback netcode that is compatible with `Rollback` and `RollbackSession` in Python (engine_adapter/rollback.py,
// engine_adapter/session.py). Sessions in both languages can play together.

const MARK = 0x31525354; // "TSR1"
const NO_TICK = 0xffffffff;
const HEAD_SIZE = 42;
const LEAD_SMOOTHING = 0.1; // weight of the newest message in the estimate of how far ahead this machine is

/** Error of a refused call of `Rollback` or `RollbackSession`. A refused call changes nothing. */
export class SessionError extends Error {
  constructor(text) {
    super(text);
    this.name = "SessionError";
  }
}

function whole(value, name, low, high) {
  if (Number.isInteger(value) && value >= low && value <= high) return value;
  throw new SessionError(`${name} must be a whole number from ${low} to ${high}, got ${value}`);
}

/** Snapshots of the last steps of a world. Call `save` before each step. To go back, call `rewindTo`. */
export class Rollback {
  #world;
  #ticks;
  #snapshots = new Map(); // by step count, ascending
  #restoreCount; // `restoreCount` of the world when the snapshots were stored

  constructor(world, ticks) {
    this.#world = world;
    this.#ticks = whole(ticks, "ticks", 1, 1e6);
    this.#restoreCount = world.restoreCount;
  }

  /** Step counts that `rewindTo` can restore, in ascending order. */
  get steps() {
    return this.#isPast ? [...this.#snapshots.keys()] : [];
  }

  // True if the snapshots are from the past of the current state.
  get #isPast() {
    return this.#restoreCount === this.#world.restoreCount;
  }

  /** Store the current state. Call this between a step and the inputs of the next step. */
  save() {
    if (!this.#isPast) {
      this.#snapshots.clear();
      this.#restoreCount = this.#world.restoreCount;
    }
    const now = this.#world.clock.steps;
    this.#snapshots.delete(now);
    this.#snapshots.set(now, this.#world.snapshot());
    // The newest snapshot is of the current state.
    while (this.#snapshots.size > this.#ticks + 1) this.#snapshots.delete(this.#snapshots.keys().next().value);
  }

  /** Restore the state that `save` stored at a step count, and drop later states. */
  rewindTo(step) {
    if (!this.#isPast) {
      throw new SessionError(
        `step ${step} is not stored: the world was restored to another state since. Rewind after the next save`,
      );
    }
    const saved = this.#snapshots.get(step);
    if (!saved) {
      const { steps } = this;
      const kept = steps.length ? `${steps[0]} to ${steps.at(-1)}` : "none yet";
      throw new SessionError(`step ${step} is not stored (stored: ${kept}): use more ticks, or rewind less`);
    }
    this.#world.restore(saved);
    this.#restoreCount = this.#world.restoreCount;
    for (const each of this.steps) if (each > step) this.#snapshots.delete(each);
  }
}

const isSame = (a, b) => a.length === b.length && a.every((each, i) => each === b[i]);

function dropBefore(rows, tick) {
  for (const each of rows.keys()) if (each < tick) rows.delete(each);
}

/**
 * The session of one machine. `advance` makes a tick with this machine's input and predicted inputs of the other
 * players. `message` returns a datagram for all other machines. `receive` reads a datagram from another machine;
 * datagrams can arrive late, repeatedly or out of order. Before each step, the session calls `act(inputs)` to apply the
 * inputs of all players. A tick can be made several times.
 */
export class RollbackSession {
  #world;
  #act;
  #settings;
  #others;
  #rollback;
  #start;
  #tick;
  #inputs; // known inputs, by player and tick
  #used = new Map(); // inputs with which each tick was made
  #heard; // by player, the first tick without a known input
  #acknowledged; // by player, the first own input that the player has not received
  #wrong = null; // first tick with a wrong prediction
  #hashes = new Map(); // own hashes, by tick
  #theirHashes; // hashes still to compare, by player and tick
  #newest; // by player, the tick of the newest message
  #leads;
  #waits = 0;
  #rollbacks = 0;
  #longestRewind = 0;
  #desync = null;

  constructor(
    world,
    act,
    {
      player,
      players = 2,
      inputSize,
      dt = 1 / 60,
      substeps = 0,
      ticks = 30,
      delay = 0,
      hashEvery = 60,
      patience = 600,
    },
  ) {
    this.#settings = {
      players: whole(players, "players", 2, 16),
      player: whole(player, "player", 0, players - 1),
      inputSize: whole(inputSize, "inputSize", 1, 64),
      ticks: whole(ticks, "ticks", 1, 1000),
      delay: whole(delay, "delay", 0, ticks),
      hashEvery: whole(hashEvery, "hashEvery", 1, 10_000),
      patience: whole(patience, "patience", 1, 1e6),
      dt,
      substeps,
    };
    this.#rollback = new Rollback(world, ticks);
    this.#world = world;
    this.#act = act;
    const everybody = Array.from({ length: players }, (_, i) => i);
    this.#others = everybody.filter((each) => each !== player);
    this.#start = BigInt(`0x${world.hash()}`);
    const first = world.clock.steps;
    this.#tick = first;
    this.#inputs = everybody.map(() => new Map([[first - 1, new Uint8Array(inputSize)]]));
    this.#theirHashes = everybody.map(() => new Map());
    this.#leads = everybody.map(() => 0);
    [this.#heard, this.#acknowledged, this.#newest] = [0, 1, 2].map(() => everybody.map(() => first));
    for (let i = 0; i < delay; i += 1) this.#learn(player, new Uint8Array(inputSize));
  }

  /** Number of the tick that `advance` makes next. */
  get tick() {
    return this.#tick;
  }

  /** First tick with an unknown input. No message can change earlier ticks. */
  get confirmed() {
    return Math.min(...this.#heard);
  }

  /** Estimated number of ticks by which this machine is ahead of the slowest other machine; below 0 if it is behind. */
  get ahead() {
    return Math.max(...this.#others.map((each) => this.#leads[each]));
  }

  /** First tick at whose start the states of two machines differ; null if all compared states agree. */
  get desync() {
    return this.#desync;
  }

  get rollbacks() {
    return this.#rollbacks;
  }

  /** Largest number of ticks of a single rewind. */
  get longestRewind() {
    return this.#longestRewind;
  }

  /** Correct wrong predictions, then make a tick. Return false if this machine must wait for another player. */
  advance(ownInput) {
    const { player, inputSize, ticks } = this.#settings;
    if (!(ownInput instanceof Uint8Array) || ownInput.length !== inputSize) {
      throw new SessionError(`ownInput must be a Uint8Array of ${inputSize} bytes, got ${ownInput}`);
    }
    this.settle();
    if (this.#tick - this.confirmed >= ticks) {
      this.#wait();
      return false;
    }
    this.#waits = 0;
    const tick = this.#heard[player];
    this.#learn(player, Uint8Array.from(ownInput)); // copies the bytes, because the caller may reuse the array
    try {
      this.#makeTick();
    } catch (error) {
      this.#inputs[player].delete(tick);
      this.#heard[player] = tick;
      throw error;
    }
    this.#tick += 1;
    this.#forget();
    return true;
  }

  /** Repeat the ticks with wrong predictions. Return the number of repeated ticks. */
  settle() {
    if (this.#wrong !== null) {
      this.#rollback.rewindTo(this.#wrong);
      this.#rollbacks += 1;
      this.#longestRewind = Math.max(this.#longestRewind, this.#tick - this.#wrong);
      this.#wrong = null;
    }
    const missing = this.#tick - this.#world.clock.steps;
    if (missing < 0) {
      throw new SessionError(`the world made ${-missing} steps outside its session: call only session.advance`);
    }
    for (let i = 0; i < missing; i += 1) this.#makeTick();
    this.#compare();
    return missing;
  }

  /** Return a datagram for all other machines. Send it after each call of `advance`, even if that returned false. */
  message() {
    const { player, players, inputSize, ticks, hashEvery } = this.#settings;
    const first = Math.min(...this.#others.map((each) => this.#acknowledged[each]));
    const count = this.#heard[player] - first;
    // Leave out hashes of states that a rewind or a late input can still change.
    const final = Math.min(this.confirmed, this.#wrong ?? this.#tick);
    const tick = Math.max(...[...this.#hashes.keys()].filter((each) => each <= final));
    const data = new Uint8Array(HEAD_SIZE + 4 * players + inputSize * count);
    const view = new DataView(data.buffer);
    view.setUint32(0, MARK, true);
    view.setBigUint64(4, this.#start, true);
    [player, players].forEach((each, i) => view.setUint8(12 + i, each));
    [inputSize, ticks, hashEvery].forEach((each, i) => view.setUint16(14 + 2 * i, each, true));
    view.setUint32(20, this.#tick, true);
    view.setUint32(24, this.#hashes.has(tick) ? tick : NO_TICK, true);
    view.setBigUint64(28, this.#hashes.get(tick) ?? 0n, true);
    view.setUint32(36, first, true);
    view.setUint16(40, count, true);
    this.#heard.forEach((each, i) => view.setUint32(HEAD_SIZE + 4 * i, each, true));
    for (let i = 0; i < count; i += 1) {
      data.set(this.#inputs[player].get(first + i), HEAD_SIZE + 4 * players + inputSize * i);
    }
    return data;
  }

  /** Read a message from another machine. The next `advance` or `settle` repeats the ticks that it corrects. */
  receive(data) {
    const message = this.#read(data);
    const other = message.player;
    message.inputs.forEach((each, i) => {
      const tick = message.first + i;
      if (tick < this.#heard[other]) return;
      this.#learn(other, each);
      const used = this.#used.get(tick);
      if (used && !isSame(used[other], each)) this.#wrong = Math.min(this.#wrong ?? tick, tick);
    });
    const { player, delay } = this.#settings;
    const heard = message.heard[player];
    this.#acknowledged[other] = Math.max(this.#acknowledged[other], heard);
    if (message.hashTick !== NO_TICK) this.#theirHashes[other].set(message.hashTick, message.hash);
    if (message.tick > this.#newest[other]) {
      this.#newest[other] = message.tick;
      // Each machine receives the other's tick late. If the latency is equal in both directions, half of the difference
      // is this machine's lead.
      const lead = (this.#tick - message.tick - (message.tick - (heard - delay))) / 2;
      this.#leads[other] += LEAD_SMOOTHING * (lead - this.#leads[other]);
    }
  }

  // Parses and checks a message.
  #read(data) {
    const { player, players, inputSize, ticks, hashEvery } = this.#settings;
    const body = HEAD_SIZE + 4 * players;
    if (data instanceof ArrayBuffer) data = new Uint8Array(data);
    const view = data instanceof Uint8Array ? new DataView(data.buffer, data.byteOffset, data.byteLength) : null;
    if (!view || data.length < body || view.getUint32(0, true) !== MARK) {
      throw new SessionError("these bytes are not a message of a session of this version");
    }
    const theirs = [view.getUint8(13), ...[14, 16, 18].map((at) => view.getUint16(at, true))];
    const ours = [players, inputSize, ticks, hashEvery];
    if (!isSame(theirs, ours)) {
      const names = "players, inputSize, ticks, hashEvery";
      throw new SessionError(`${names} are ${theirs.join(", ")} there and ${ours.join(", ")} here: use the same values on all machines`);
    }
    const start = view.getBigUint64(4, true);
    if (start !== this.#start) {
      const [there, here] = [start, this.#start].map((each) => each.toString(16).padStart(16, "0"));
      throw new SessionError(
        `the other world's initial state is ${there}, this one's is ${here}: run the same script, of the same version, on all machines`,
      );
    }
    const message = {
      player: view.getUint8(12),
      tick: view.getUint32(20, true),
      hashTick: view.getUint32(24, true),
      hash: view.getBigUint64(28, true),
      first: view.getUint32(36, true),
      heard: Array.from({ length: players }, (_, i) => view.getUint32(HEAD_SIZE + 4 * i, true)),
    };
    const count = view.getUint16(40, true);
    if (!this.#others.includes(message.player)) {
      throw new SessionError(`player ${message.player} is not another player: this machine is player ${player}`);
    }
    if (data.length !== body + inputSize * count) {
      throw new SessionError(`a message of ${count} inputs has ${data.length} bytes: it is damaged`);
    }
    const inputAt = (i) => Uint8Array.from(data.subarray(body + inputSize * i, body + inputSize * (i + 1)));
    message.inputs = Array.from({ length: count }, (_, i) => inputAt(i));
    this.#requireOrder(message);
    return message;
  }

  // Checks that a message agrees with earlier messages.
  #requireOrder({ player, tick, hashTick, first, heard, inputs }) {
    const who = `player ${player}`;
    const due = this.#heard[player];
    const own = this.#heard[this.#settings.player];
    if (first > due) {
      throw new SessionError(`${who} sends no input before tick ${first}, and that of ${due} is missing`);
    }
    const most = own + 2 * this.#settings.ticks; // a correct machine never sends later ticks
    if (Math.max(first + inputs.length, tick, hashTick === NO_TICK ? -1 : hashTick) > most) {
      throw new SessionError(`${who} is beyond tick ${most}, which no machine of this session can have reached`);
    }
    if (heard[this.#settings.player] > own) {
      throw new SessionError(`${who} acknowledges an input that was not sent: the message is damaged`);
    }
    inputs.forEach((each, i) => {
      const known = this.#inputs[player].get(first + i);
      if (known && !isSame(known, each)) {
        throw new SessionError(`${who} sends another input for tick ${first + i} than before`);
      }
    });
  }

  #learn(player, input) {
    this.#inputs[player].set(this.#heard[player], input);
    this.#heard[player] += 1;
  }

  // Saves the state, applies known or predicted inputs, and makes a step. An error changes nothing.
  #makeTick() {
    const tick = this.#world.clock.steps;
    this.#rollback.save();
    if (tick % this.#settings.hashEvery === 0) this.#hashes.set(tick, BigInt(`0x${this.#world.hash()}`));
    const used = this.#inputs.map((known, player) => known.get(Math.min(tick, this.#heard[player] - 1)));
    try {
      this.#act(used);
      this.#world.step(this.#settings.dt, this.#settings.substeps);
    } catch (error) {
      this.#rollback.rewindTo(tick);
      throw error;
    }
    this.#used.set(tick, used);
  }

  // Counts a call of `advance` that made no tick.
  #wait() {
    this.#waits += 1;
    if (this.#waits < this.#settings.patience) return;
    const tick = this.confirmed;
    const silent = this.#others.filter((each) => this.#heard[each] === tick).join(" and ");
    throw new SessionError(
      `no input of player ${silent} for tick ${tick} came in ${this.#waits} frames, and ${this.#settings.ticks} ticks ` +
        "are already predicted: end the session, or keep waiting",
    );
  }

  // Compares own and received hashes of states that late inputs cannot change.
  #compare() {
    for (const hashes of this.#theirHashes) {
      for (const [tick, theirs] of hashes) {
        if (tick > this.confirmed || !this.#hashes.has(tick)) continue;
        hashes.delete(tick);
        if (theirs !== this.#hashes.get(tick)) this.#desync = Math.min(this.#desync ?? tick, tick);
      }
    }
  }

  // Drops data that neither a rewind nor a message needs.
  #forget() {
    const { player, ticks, delay, hashEvery } = this.#settings;
    const { confirmed } = this;
    const unsent = Math.min(...this.#others.map((each) => this.#acknowledged[each]));
    this.#inputs.forEach((known, each) => {
      // Keep the last known input, for predictions.
      dropBefore(known, Math.min(each === player ? unsent : confirmed, confirmed) - 1);
    });
    dropBefore(this.#used, confirmed);
    const oldest = this.#tick - 4 * ticks - delay - hashEvery;
    for (const hashes of [this.#hashes, ...this.#theirHashes]) dropBefore(hashes, oldest);
  }
}
