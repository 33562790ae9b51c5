import type { World } from "./taichi-soft.js";

export class SessionError extends Error {}

export class Rollback {
  constructor(world: World, ticks: number);
  readonly steps: number[];
  save(): void;
  rewindTo(step: number): void;
}

/** Options of a session. All machines must use the same options, except `player`, `delay` and `patience`. */
export interface SessionOptions {
  /** Number of this machine's player, from 0. */
  player: number;
  /** Number of players, 2 to 16. */
  players?: number;
  /** Size of an input [bytes], 1 to 64. */
  inputSize: number;
  /** Length of a tick [s]. */
  dt?: number;
  /** Number of substeps per tick. With 0, a stable number is chosen. */
  substeps?: number;
  /** Largest number of ticks made on predictions. */
  ticks?: number;
  /** Number of ticks until an input of this machine takes effect. */
  delay?: number;
  /** Number of ticks between comparisons of hashes. */
  hashEvery?: number;
  /** Number of consecutive `advance` calls that make no tick, after which `advance` throws an error. */
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
