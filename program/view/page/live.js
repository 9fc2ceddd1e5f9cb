// SPDX-License-Identifier: MIT
// Show the states of the lungs that the server of this page sends by WebSocket. If the user clicks a button, send the
// tilt of this device to the server.

const said = document.createElement('p');
const aged = document.createElement('p');
const tilt = document.createElement('button');
const bar = document.createElement('div');
bar.id = 'live';
bar.style.cssText = 'display:flex;gap:8px;align-items:center;margin-top:4px;pointer-events:auto';
said.style.cssText = aged.style.cssText = 'margin:0;font-size:12px';
said.setAttribute('role', 'status');
tilt.type = 'button';
tilt.textContent = "Use this device's tilt";
tilt.title = 'Lay the phone on the breastbone, screen outwards, top towards the head';
tilt.hidden = typeof DeviceOrientationEvent === 'undefined' || !window.isSecureContext;
bar.append(said, aged, tilt);
(document.querySelector('#title') ?? document.body).append(bar);
document.body.classList.add('waiting'); // grey until the first pose

let socket = null;
let moments = 0;
let posed = NaN; // time of the newest pose, ms of performance.now(); NaN before the first pose

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Return the quaternion q of the patient's orientation (x, y, z, w), rotated by the least angle that makes gravity,
 * in the patient's axes, point along `gravity`. */
function turned(q, gravity) {
  const now = window.supine.gravityOf(q);
  let [axis, w] = [cross(gravity, now), 1 + dot(gravity, now)];
  // Opposite directions: turn by 180 degrees about z or x
  if (w < 1e-9) [axis, w] = [Math.abs(now[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], 0];
  const u = cross(q, axis); // cross-product term of the quaternion product q * (axis, w)
  const product = [0, 1, 2].map((i) => q[3] * axis[i] + w * q[i] + u[i]);
  const all = [...product, q[3] * w - dot(q, axis)];
  const length = Math.hypot(...all);
  return all.map((x) => x / length);
}

/** Show a state: gravity in the patient's axes (x left, y back, z head), and the volume above rest, mL. `age` is
 * the age of the newest pose, s, or negative if there is no pose, and `refused` the reason if the last pose of a device
 * was refused. */
function show({ gravity, above, age, refused = '' }) {
  const news = refused || 'live';
  if (said.textContent !== news) said.textContent = news;
  posed = age < 0 ? NaN : performance.now() - 1000 * age;
  tellAge();
  const page = window.supine;
  if (!page) {
    // the page still reads the lungs
    requestAnimationFrame(() => show({ gravity, above, age, refused }));
    return;
  }
  moments += 1;
  page.state.playing = false;
  page.state.live = true;
  document.body.classList.toggle('waiting', Number.isNaN(posed));
  page.state.depth = above;
  page.state.settle(turned(page.state.q, gravity), 0, 0);
  page.touch();
}

function tellAge() {
  const age = (performance.now() - posed) / 1000;
  const text = Number.isNaN(age) ? 'no tracker yet' : `pose ${age < 10 ? age.toFixed(1) : age.toFixed(0)} s old`;
  if (aged.textContent !== text) aged.textContent = text;
}
setInterval(tellAge, 500);

/** Return the direction of gravity in the patient's axes from the tilt of a phone on the breastbone, degrees. The
 * phone's axes, x right, y up and z out of the screen, point to the patient's left, head and front.
 * DeviceOrientation rotates the phone by alpha about z, beta about x and gamma about y in a world whose z is up. */
function gravityOfTilt(beta, gamma) {
  const [b, c] = [beta, gamma].map((degrees) => (degrees * Math.PI) / 180);
  return [Math.cos(b) * Math.sin(c), Math.cos(b) * Math.cos(c), -Math.sin(b)];
}

function connect() {
  socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/`, 'supine');
  socket.addEventListener('open', () => {
    said.textContent = 'live';
  });
  socket.addEventListener('message', (event) => show(JSON.parse(event.data)));
  socket.addEventListener('close', () => {
    said.textContent = 'waiting for the server';
    setTimeout(connect, 1000);
  });
}

tilt.addEventListener('click', async () => {
  if (DeviceOrientationEvent.requestPermission && (await DeviceOrientationEvent.requestPermission()) !== 'granted')
    return;
  tilt.hidden = true;
  window.addEventListener('deviceorientation', ({ beta, gamma }) => {
    if (beta === null || gamma === null || socket.readyState !== WebSocket.OPEN || socket.bufferedAmount > 0) return;
    socket.send(JSON.stringify({ gravity: gravityOfTilt(beta, gamma) }));
  });
});

connect();
window.supineLive = { gravityOfTilt, moments: () => moments, age: () => aged.textContent };
