// Power spectral density after Welch: Hann windows, half overlap, one-sided.

const SEGMENTS = 4;

/** {frequency, density} of an evenly sampled signal, without its zero line. */
export function density(time, values) {
  const count = values.length;
  const rate = (count - 1) / (time[count - 1] - time[0]);
  const size = 2 ** Math.max(4, Math.floor(Math.log2((2 * count) / (SEGMENTS + 1))));
  if (!(rate > 0) || count < size) return { frequency: [], density: [] };
  const window = Float64Array.from({ length: size }, (_, i) =>
    0.5 - 0.5 * Math.cos((2 * Math.PI * i) / size));
  const power = new Float64Array(size / 2);
  let taken = 0;
  for (let start = 0; start + size <= count; start += size / 2, taken++) {
    const part = values.subarray(start, start + size);
    const mean = part.reduce((sum, v) => sum + v, 0) / size;
    const re = Float64Array.from(part, (v, i) => (v - mean) * window[i]);
    const im = new Float64Array(size);
    transform(re, im);
    for (let k = 0; k < size / 2; k++) power[k] += re[k] ** 2 + im[k] ** 2;
  }
  const scale = 2 / (taken * rate * window.reduce((sum, w) => sum + w * w, 0));
  const keep = Array.from({ length: size / 2 - 1 }, (_, k) => k + 1);
  return {
    frequency: keep.map((k) => (k * rate) / size),
    density: keep.map((k) => power[k] * scale),
  };
}

/** Fast Fourier transform in place, length a power of two. */
function transform(re, im) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let size = 2; size <= n; size *= 2) {
    const half = size / 2;
    for (let k = 0; k < half; k++) {
      const angle = (-2 * Math.PI * k) / size;
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (let a = k; a < n; a += size) {
        const b = a + half;
        const x = c * re[b] - s * im[b];
        const y = s * re[b] + c * im[b];
        re[b] = re[a] - x;
        im[b] = im[a] - y;
        re[a] += x;
        im[a] += y;
      }
    }
  }
}
