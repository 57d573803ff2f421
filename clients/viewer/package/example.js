// The example page: draws part 0 as dots, lit by their normals, and lets the pointer pull it.
import { join } from "./src/client.js";

const text = document.getElementById("text");
const canvas = document.getElementById("canvas");
const pen = canvas.getContext("2d");
let hello, shape, grasped; // grasped: the place of the tool, m
const cross = (a, b) => [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
const dot = (a, b, at = 0) => a[0] * b[at] + a[1] * b[at + 1] + a[2] * b[at + 2];

const session = join(
    location.href,
    (message) => {
        if (message.type === "state") text.textContent = message.text;
        if (message.type === "frame" && message.part === 0) shape = message;
        if (message.type === "control" && message.message.type === "hello") hello = viewed(message.message);
        if (message.type !== "tools" || !hello) return;
        const force = Math.hypot(...(message.tools[hello.you.tool]?.force ?? [0]));
        text.textContent = `${hello.title}: ${force.toFixed(3)} N`;
        if (grasped) session.move(grasped, true);
    },
    { role: "trainee" },
);

/** adds the axes of the picture and the way from m to pixels */
function viewed(message) {
    const { up, box_min_m: low, box_max_m: high } = message;
    const right = cross(up, Math.abs(up[1]) < 0.9 ? [0, 1, 0] : [0, 0, 1]);
    const axes = [right.map((v) => v / Math.hypot(...right)), up];
    const middle = low.map((v, i) => (v + high[i]) / 2);
    const scale = 640 / Math.hypot(...low.map((v, i) => high[i] - v));
    return { ...message, axes, front: cross(axes[0], up), middle, scale };
}
const pixel = (axis, at) =>
    400 +
    (1 - 2 * axis) * hello.scale * (dot(hello.axes[axis], shape.positions, at) - dot(hello.axes[axis], hello.middle));

function draw() {
    requestAnimationFrame(draw);
    pen.clearRect(0, 0, 800, 800);
    for (let at = 0; hello && shape && at < shape.positions.length; at += 3) {
        const light = dot(hello.front, shape.normals, at);
        if (light <= 0) continue;
        pen.fillStyle = `rgb(${80 + 150 * light} 60 50)`;
        pen.fillRect(pixel(0, at), pixel(1, at), 3, 3);
    }
}
draw();

canvas.onpointerdown = (event) => {
    let nearest = Infinity;
    for (let at = 0; at < shape.positions.length; at += 3) {
        const distance = Math.hypot(pixel(0, at) - event.offsetX, pixel(1, at) - event.offsetY);
        if (distance > nearest || dot(hello.front, shape.normals, at) <= 0) continue;
        nearest = distance;
        grasped = Array.from(shape.positions.slice(at, at + 3));
    }
    session.move(grasped, false);
    canvas.setPointerCapture(event.pointerId);
};
canvas.onpointermove = (event) => {
    if (!grasped) return;
    const [x, y] = [event.movementX / hello.scale, -event.movementY / hello.scale];
    grasped = grasped.map((v, i) => v + x * hello.axes[0][i] + y * hello.axes[1][i]);
    session.move(grasped, true);
};
canvas.onpointerup = () => {
    grasped = null;
    session.lift();
};
