// Colour scales of the points and of the maps, the same in the shaders, the pictures and the legend.

// Diverging (ColorBrewer RdBu, darker in the middle) and sequential (viridis), distinct to the colour-blind.
const DIVERGING = [0x2166ac, 0x67a9cf, 0xdfe3e6, 0xef8a62, 0xb2182b];
const SEQUENTIAL = [0x440154, 0x3b528b, 0x21918c, 0x5ec962, 0xfde725];
export const SCANS = [0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0x8a6d00, 0x56b4e9, 0x5b4a9c, 0x7a7a7a];

export const stopsOf = (kind) => (kind === "residual" ? DIVERGING : SEQUENTIAL);
export const ofScan = (index) => SCANS[index % SCANS.length];
export const hex = (colour) => `#${colour.toString(16).padStart(6, "0")}`;

/** Red, green, blue (0 to 255) at `share` of a scale, held at its ends. */
export function colourAt(stops, share) {
  const at = Math.max(0, Math.min(1, share)) * (stops.length - 1);
  const first = Math.min(stops.length - 2, Math.floor(at));
  const part = (colour, shift) => (colour >> shift) & 255;
  return [16, 8, 0].map((shift) => {
    const from = part(stops[first], shift);
    return Math.round(from + (at - first) * (part(stops[first + 1], shift) - from));
  });
}

/** The least round number that is not below `value`. */
export function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find((step) => step * power >= value * 0.999) * power;
}
