// Rows of numbers that come in pieces and are looked up by time.

export function makeRows(width, rate_hz) {
  let rows = [];
  let first = 0;
  return {
    rate_hz,
    append(numbers) {
      for (let at = 0; at < numbers.length; at += width) rows.push(numbers.subarray(at, at + width));
    },
    // Seconds of which there are rows.
    end_s: () => (first + rows.length) / rate_hz,
    // The row of a moment, the next one, and how far it is on its way there, 0 to 1.
    at(time_s) {
      const place = Math.min(Math.max(time_s * rate_hz - first, 0), rows.length - 1);
      const index = Math.floor(place + 1e-6);
      return { row: rows[index], next: rows[index + 1] ?? rows[index], share: Math.max(place - index, 0) };
    },
    // Lets go of all but the last seconds: a microphone never ends.
    keep(seconds) {
      const surplus = rows.length - Math.ceil(seconds * rate_hz);
      if (surplus <= 0) return;
      rows = rows.slice(surplus);
      first += surplus;
    },
    all: () => rows,
  };
}
