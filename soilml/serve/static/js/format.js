// Numbers as an engineer writes them: three digits, no powers of ten in the usual range.

const MINUS = "\u2212";
const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const raised = (power) => power.replace("-", "⁻").replace(/\d/g, (digit) => RAISED[digit]);

export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e6 || size < 1e-4
    ? value.toExponential(digits - 1).replace(/e\+?(-?\d+)/, (_, power) => ` × 10${raised(power)}`)
    : value.toLocaleString("en", {
      useGrouping: false,
      minimumFractionDigits: 0,
      maximumFractionDigits: Math.max(0, digits - 1 - Math.floor(Math.log10(size))),
    });
  return text.replace("-", MINUS);
}

export const withUnit = (value, unit, digits = 3) => {
  const space = unit === "°" || !unit ? "" : "\u00a0";
  return `${number(value, digits)}${space}${unit}`;
};

export const percent = (share) => `${Math.round(100 * share)}\u00a0%`;

export const counted = (count, thing) => `${count} ${thing}${count === 1 ? "" : "s"}`;

export const bytes = (count) =>
  count < 1e6 ? `${Math.max(1, Math.round(count / 1024))} kB` : `${Math.round(count / 2 ** 20)} MB`;
