// Colours of light: from colour temperatures and linear RGB to what a page draws, and back.

const RGB_FROM_XYZ = [
  [3.2404542, -1.5371385, -0.4985314],
  [-0.969266, 1.8760108, 0.041556],
  [0.0556434, -0.2040259, 1.0572252],
];
const LUMINANCE = [0.2126, 0.7152, 0.0722];

/** Linear RGB of luminance 1 of a black body (below 4000 K) or daylight (above 5000 K), as the camera has it. */
export function linearOfKelvin(kelvin) {
  const share = Math.min(1, Math.max(0, (kelvin - 4000) / 1000));
  const [warm, cool] = [blackBody(kelvin), daylight(Math.max(kelvin, 4000))];
  const x = (1 - share) * warm[0] + share * cool[0];
  const y = (1 - share) * warm[1] + share * cool[1];
  const xyz = [x / y, 1, (1 - x - y) / y];
  const rgb = RGB_FROM_XYZ.map((row) => Math.max(0, row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]));
  const light = rgb.reduce((sum, value, index) => sum + value * LUMINANCE[index], 0);
  return rgb.map((value) => value / light);
}

/** Chromaticity of a black body: Kim et al. 2002, 1667 to 25000 K. */
function blackBody(t) {
  const x = t < 4000
    ? -0.2661239e9 / t ** 3 - 0.2343589e6 / t ** 2 + 0.8776956e3 / t + 0.17991
    : -3.0258469e9 / t ** 3 + 2.1070379e6 / t ** 2 + 0.2226347e3 / t + 0.24039;
  if (t < 2222) return [x, -1.1063814 * x ** 3 - 1.3481102 * x ** 2 + 2.18555832 * x - 0.20219683];
  if (t < 4000) return [x, -0.9549476 * x ** 3 - 1.37418593 * x ** 2 + 2.09137015 * x - 0.16748867];
  return [x, 3.081758 * x ** 3 - 5.8733867 * x ** 2 + 3.75112997 * x - 0.37001483];
}

/** Chromaticity of daylight: CIE 15, 4000 to 25000 K. */
function daylight(t) {
  const x = t <= 7000
    ? -4.607e9 / t ** 3 + 2.9678e6 / t ** 2 + 0.09911e3 / t + 0.244063
    : -2.0064e9 / t ** 3 + 1.9018e6 / t ** 2 + 0.24748e3 / t + 0.23704;
  return [x, -3 * x ** 2 + 2.87 * x - 0.275];
}

const encode = (value) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
const decode = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);

/** The colour #rrggbb of linear RGB, its largest channel full: the hue of a light, not how bright it is. */
export function hexOfLinear(rgb) {
  const most = Math.max(...rgb, 1e-6);
  return `#${rgb.map((value) => Math.round(255 * encode(value / most)).toString(16).padStart(2, "0")).join("")}`;
}

/** Linear RGB of #rrggbb, its luminance 1, so that a lamp of another colour stays as bright. Black is white. */
export function linearOfHex(hex) {
  const rgb = [1, 3, 5].map((start) => decode(parseInt(hex.slice(start, start + 2), 16) / 255));
  const light = rgb.reduce((sum, value, index) => sum + value * LUMINANCE[index], 0);
  return light > 1e-4 ? rgb.map((value) => Number((value / light).toFixed(4))) : [1, 1, 1];
}

/** A lamp's colour, #rrggbb. */
export function lampHex(lamp) {
  if (lamp.color) return hexOfLinear(lamp.color);
  return hexOfLinear(lamp.kelvin ? linearOfKelvin(lamp.kelvin) : [1, 1, 1]);
}
