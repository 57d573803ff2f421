// A bounded history of samples: a time and named columns of numbers, of which a row may lack some. Pure.

/**
 * Times increase; a sample of an earlier time (another recording, a restarted server) begins a new history. Arrays are
 * twice the capacity: rows are appended, and the newest move to the front when the end is reached, so that the history
 * is always one piece of each array.
 */
export class SampleRing {
    /** @param {number} capacity rows that are kept @param {number} columnLimit columns that are kept */
    constructor(capacity, columnLimit) {
        this.capacity = capacity;
        this.columnLimit = columnLimit;
        this.times = new Float64Array(2 * capacity);
        /** @type {Map<string, Float32Array>} NaN where a row lacks the column */
        this.columns = new Map();
        this.nWritten = 0;
    }

    /** rows of the history */
    get n() {
        return Math.min(this.nWritten, this.capacity);
    }

    get lastTime() {
        return this.nWritten ? this.times[this.nWritten - 1] : -Infinity;
    }

    clear() {
        this.nWritten = 0;
        this.columns.clear();
    }

    /** @param {number} time @param {Record<string, number>} row */
    push(time, row) {
        if (time < this.lastTime) this.clear();
        if (time === this.lastTime) return;
        if (this.nWritten === 2 * this.capacity) this.compact();
        const at = this.nWritten++;
        this.times[at] = time;
        for (const values of this.columns.values()) values[at] = NaN;
        for (const [name, value] of Object.entries(row)) {
            const values = this.columns.get(name) ?? this.add(name);
            if (values) values[at] = value;
        }
    }

    /** @param {string} name @returns {Float32Array | null} null: there are too many */
    add(name) {
        if (this.columns.size >= this.columnLimit) return null;
        const values = new Float32Array(2 * this.capacity).fill(NaN);
        this.columns.set(name, values);
        return values;
    }

    /** moves the newest rows to the front, and forgets columns without a value in them */
    compact() {
        const { capacity, nWritten } = this;
        // one row less, so that the history stays full with the row that follows
        const from = nWritten - capacity + 1;
        this.times.copyWithin(0, from, nWritten);
        for (const [name, values] of this.columns) {
            values.copyWithin(0, from, nWritten);
            if (values.subarray(0, nWritten - from).every(Number.isNaN)) this.columns.delete(name);
        }
        this.nWritten = nWritten - from;
    }

    /** index of the first row that is not before a time @param {number} time */
    firstFrom(time) {
        let low = this.nWritten - this.n;
        let high = this.nWritten;
        while (low < high) {
            const middle = (low + high) >> 1;
            if (this.times[middle] < time) low = middle + 1;
            else high = middle;
        }
        return low;
    }

    /**
     * The history from a time on, without copies.
     * @param {number} time @returns {{times: Float64Array, columns: Map<string, Float32Array>}}
     */
    since(time) {
        const from = this.firstFrom(time);
        const piece = (/** @type {Float32Array} */ values) => values.subarray(from, this.nWritten);
        return {
            times: this.times.subarray(from, this.nWritten),
            columns: new Map([...this.columns].map(([name, values]) => [name, piece(values)])),
        };
    }
}
