// SPDX-License-Identifier: MIT
// The page follows: moments come by WebSocket from the server that sent the page; this device's own
// tilt goes back, where someone asks for it.

const supineLive = (() => {
  const said = document.createElement('p');
  const tilt = document.createElement('button');
  const bar = document.createElement('div');
  bar.id = 'live';
  bar.style.cssText = 'position:fixed;right:12px;bottom:12px;display:flex;gap:8px;align-items:center;z-index:9';
  said.style.cssText = 'margin:0;font-size:12px';
  said.setAttribute('role', 'status');
  tilt.type = 'button';
  tilt.textContent = "Use this device's tilt";
  tilt.title = 'Lay the phone on the breastbone, screen out, its top towards the head';
  tilt.hidden = typeof DeviceOrientationEvent === 'undefined' || !window.isSecureContext;
  bar.append(said, tilt);
  document.body.append(bar);

  let socket = null;
  let moments = 0;

  /** Where things fall, in the patient's axes (x left, y back, z head), of a phone that lies on the
   * breastbone. Its own axes are x right of the screen, y up it, z out of it: left, head, front.
   * DeviceOrientation turns it by alpha about z, beta about x, gamma about y; the world's z is up. */
  function gravityOfTilt(beta, gamma) {
    const [b, c] = [beta, gamma].map((degrees) => (degrees * Math.PI) / 180);
    const down = [Math.cos(b) * Math.sin(c), -Math.sin(b), -Math.cos(b) * Math.cos(c)];
    return [down[0], -down[2], down[1]];
  }

  function connect() {
    socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/`, 'supine');
    socket.addEventListener('open', () => { said.textContent = 'live'; });
    socket.addEventListener('message', (event) => {
      const { gravity, volume } = JSON.parse(event.data);
      moments += 1;
      window.supine?.follow(gravity, volume);
    });
    socket.addEventListener('close', () => {
      said.textContent = 'waiting for the server';
      setTimeout(connect, 1000);
    });
  }

  tilt.addEventListener('click', async () => {
    if (DeviceOrientationEvent.requestPermission && await DeviceOrientationEvent.requestPermission() !== 'granted') return;
    tilt.hidden = true;
    window.addEventListener('deviceorientation', ({ beta, gamma }) => {
      if (beta === null || gamma === null || socket.readyState !== WebSocket.OPEN || socket.bufferedAmount > 0) return;
      socket.send(JSON.stringify({ gravity: gravityOfTilt(beta, gamma) }));
    });
  });

  connect();
  return { gravityOfTilt, moments: () => moments };
})();
window.supineLive = supineLive;
