// Formats numbers with three digits and SI prefixes.
const SCALED = new Set(["Pa", "J", "N s"]);
const PREFIXES = [[1e12, "T"], [1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"]];

export function quantity(value, unit) {
  if (value === null || value === undefined) return "various";
  const rounded = Number(value.toPrecision(3)), size = Math.abs(rounded);
  if (!SCALED.has(unit)) return `${rounded}${unit ? ` ${unit}` : ""}`;
  if (size < 1e-6) return `0 ${unit}`;
  const [factor, prefix] = PREFIXES.find(([f]) => size >= f);
  return `${Number((rounded / factor).toPrecision(3))} ${prefix}${unit}`;
}
