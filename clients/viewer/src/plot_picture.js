// The time plots as one picture: title, members, and each chart below its caption, as the panel shows them.

const MARGIN = 16; // pixels of the page
const LINE = 20; // height of a line of text

/**
 * @param {HTMLElement} panel with a list of members and figures with a caption and a canvas @param {string} title
 * @param {string} below text below the time axis
 * @returns {HTMLCanvasElement} as sharp as the charts
 */
export function picturePlots(panel, title, below) {
    const figures = [...panel.querySelectorAll("figure")].map((figure) => ({
        caption: figure.querySelector("figcaption")?.firstChild?.textContent ?? "",
        values: [...figure.querySelectorAll("figcaption b")],
        chart: /** @type {HTMLCanvasElement} */ (figure.querySelector("canvas")),
    }));
    const width = Math.max(...figures.map(({ chart }) => chart.clientWidth));
    const ratio = figures[0].chart.width / figures[0].chart.clientWidth;
    const height = figures.reduce((sum, { chart }) => sum + LINE + chart.clientHeight, 3 * LINE);
    const canvas = document.createElement("canvas");
    canvas.width = Math.round(ratio * (width + 2 * MARGIN));
    canvas.height = Math.round(ratio * (height + 2 * MARGIN));
    const context = canvas.getContext("2d");
    if (!context) return canvas;
    const style = getComputedStyle(document.documentElement);
    const [ground, ink] = ["--solid", "--ink"].map((name) => style.getPropertyValue(name).trim());
    const font = getComputedStyle(panel).fontFamily;
    context.scale(ratio, ratio);
    context.fillStyle = ground;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.translate(MARGIN, MARGIN);
    context.textBaseline = "middle";
    const write = (/** @type {string} */ text, /** @type {number} */ x, /** @type {number} */ y, colour = ink) => {
        context.fillStyle = colour;
        context.fillText(text, x, y);
        return context.measureText(text).width;
    };
    context.font = `600 15px ${font}`;
    write(title, 0, LINE / 2);
    context.font = `13px ${font}`;
    let x = 0;
    for (const item of /** @type {NodeListOf<HTMLElement>} */ (panel.querySelectorAll("#plots-members li"))) {
        context.fillStyle = item.style.getPropertyValue("--mark");
        context.fillRect(x, 1.5 * LINE - 4, 8, 8);
        x += 14 + write(item.textContent ?? "", x + 13, 1.5 * LINE) + 14;
    }
    let y = 2 * LINE;
    for (const { caption, chart } of figures) {
        write(caption, 0, y + LINE / 2);
        context.drawImage(chart, 0, y + LINE, chart.clientWidth, chart.clientHeight);
        y += LINE + chart.clientHeight;
    }
    context.textAlign = "right";
    write(below, width, y + LINE / 2);
    return canvas;
}
