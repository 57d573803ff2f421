// Elements of the page painted on a canvas where they stand: ground, border, gradient, words. Enough for the names of
// tools, the legend, the scale bar and the title, in a picture or a video.

/** colours in a computed style; `color-mix` is computed as color() */
const COLOUR = /(?:rgba?|color|oklab)\([^()]*\)/g;

/** is it drawn at all? @param {Element} element @param {CSSStyleDeclaration} style */
const isShown = (element, style) =>
    style.display !== "none" && style.visibility !== "hidden" && Number(style.opacity) > 0 && element.clientWidth > 0;

/**
 * @param {CanvasRenderingContext2D} context in pixels of the page @param {Element} element
 */
export function paintElement(context, element) {
    const style = getComputedStyle(element);
    const box = element.getBoundingClientRect();
    if (style.display === "inline") {
        for (const child of element.childNodes) paintNode(context, child, style);
        return;
    }
    if (!isShown(element, style)) return;
    context.beginPath();
    context.roundRect(box.x, box.y, box.width, box.height, parseFloat(style.borderRadius) || 0);
    context.fillStyle = groundOf(context, style, box);
    context.fill();
    paintBorder(context, style, box);
    if (element instanceof HTMLCanvasElement) context.drawImage(element, box.x, box.y, box.width, box.height);
    for (const child of element.childNodes) paintNode(context, child, style);
}

/** a colour, or the gradient over it @param {CanvasRenderingContext2D} context @param {CSSStyleDeclaration} style @param {DOMRect} box */
function groundOf(context, style, box) {
    const colours = style.backgroundImage.startsWith("linear-gradient") ? style.backgroundImage.match(COLOUR) : null;
    if (!colours || colours.length < 2) return style.backgroundColor;
    const gradient = style.backgroundImage.includes("90deg")
        ? context.createLinearGradient(box.left, 0, box.right, 0)
        : context.createLinearGradient(0, box.top, 0, box.bottom);
    colours.forEach((colour, i) => gradient.addColorStop(i / (colours.length - 1), colour));
    return gradient;
}

/** a whole border follows the corners; of others each side is a line @param {CanvasRenderingContext2D} context @param {CSSStyleDeclaration} style @param {DOMRect} box */
function paintBorder(context, style, box) {
    const widths = [style.borderTopWidth, style.borderRightWidth, style.borderBottomWidth, style.borderLeftWidth];
    const [top, right, bottom, left] = widths.map((width) => parseFloat(width) > 0);
    context.strokeStyle = style.borderBottomColor;
    context.lineWidth = 1;
    if (top && right && bottom && left) return context.stroke();
    /** @param {number[]} a @param {number[]} b */
    const line = (a, b) => {
        context.beginPath();
        context.moveTo(a[0], a[1]);
        context.lineTo(b[0], b[1]);
        context.stroke();
    };
    const [x0, y0, x1, y1] = [box.left + 0.5, box.top + 0.5, box.right - 0.5, box.bottom - 0.5];
    if (top) line([x0, y0], [x1, y0]);
    if (right) line([x1, y0], [x1, y1]);
    if (bottom) line([x0, y1], [x1, y1]);
    if (left) line([x0, y0], [x0, y1]);
}

/** @param {CanvasRenderingContext2D} context @param {ChildNode} node @param {CSSStyleDeclaration} style of its parent */
function paintNode(context, node, style) {
    if (node instanceof HTMLElement) return paintElement(context, node);
    if (!(node instanceof Text)) return;
    context.font = `${style.fontStyle} ${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
    context.fillStyle = style.color;
    context.textBaseline = "alphabetic";
    const range = document.createRange();
    // each word where the page has put it, whatever the lines are
    for (const { 0: word, index } of node.data.matchAll(/\S+/g)) {
        range.setStart(node, index);
        range.setEnd(node, index + word.length);
        const { x, y } = range.getBoundingClientRect();
        context.fillText(word, x, y + context.measureText(word).fontBoundingBoxAscent);
    }
}
