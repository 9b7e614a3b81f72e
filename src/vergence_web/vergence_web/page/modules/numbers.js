// Numbers as the page shows them: a dash where a figure is not known.

const DASH = "–";
const known = (value) => typeof value === "number" && Number.isFinite(value);

export const degrees = (radians) => (known(radians) ? (radians * 180) / Math.PI : null);

/** A number with a fixed number of digits and its unit. */
export const shown = (value, digits, unit = "") => (known(value) ? `${value.toFixed(digits)}${unit}` : DASH);

/** An angle in degrees. */
export const angle = (radians) => (known(radians) ? `${degrees(radians).toFixed(2)}°` : DASH);

/** A signed angle in degrees. */
export const signedAngle = (radians) =>
  known(radians) ? `${radians < 0 ? "" : "+"}${degrees(radians).toFixed(2)}°` : DASH;

/** A distance; "infinite" is the graph's word for parallel axes. */
export const metres = (value) => (value === "infinite" ? "∞" : shown(value, value >= 10 ? 1 : 2, " m"));
