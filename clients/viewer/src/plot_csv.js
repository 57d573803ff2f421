// Samples as CSV (RFC 4180): a row each, units in the header, empty where nothing was measured. Pure.

/** @param {string} text */
const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** nine digits restore every bit of a float @param {number} value */
const digits = (value) => (Number.isNaN(value) ? "" : String(Number(value.toPrecision(9))));

/**
 * @param {ArrayLike<number>} times simulation time, s; written to the microsecond, as the server sends it
 * @param {[header: string, values: ArrayLike<number>][]} columns
 */
export function toCsv(times, columns) {
    const lines = [["time_s", ...columns.map(([header]) => quoted(header))].join()];
    for (let i = 0; i < times.length; i++)
        lines.push([times[i].toFixed(6), ...columns.map(([, values]) => digits(values[i]))].join());
    return lines.join("\r\n") + "\r\n";
}
