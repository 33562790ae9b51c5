import type { World } from "./taichi-soft.js";

export class SessionError extends Error {}

export class Rollback {
  constructor(world: World, ticks: number);
  readonly steps: number[];
  save(): void;
  rewindTo(step: number): void;
}

/** The same on all machines, but `player`, `delay` and `patience`. */
export interface SessionOptions {
  /** Number of the own player, from 0. */
  player: number;
  /** How many there are, 2 to 16. */
  players?: number;
  /** Bytes of each input, 1 to 64. */
  inputSize: number;
  /** Length of a tick [s]. */
  dt?: number;
  /** 0 for as many as are stable. */
  substeps?: number;
  /** The most ticks made beyond the last one of which all inputs are known. */
  ticks?: number;
  /** Ticks after which an own input is used. */
  delay?: number;
  /** Ticks from one comparison of hashes to the next. */
  hashEvery?: number;
  /** Calls of `advance` in a row that may wait before one throws. */
  patience?: number;
}

export class RollbackSession {
  constructor(world: World, act: (inputs: Uint8Array[]) => void, options: SessionOptions);
  readonly tick: number;
  readonly confirmed: number;
  readonly ahead: number;
  readonly desync: number | null;
  readonly rollbacks: number;
  readonly longestRewind: number;
  advance(ownInput: Uint8Array): boolean;
  settle(): number;
  message(): Uint8Array;
  receive(data: Uint8Array): void;
}
