// Where pictures come from: a server that is asked over a WebSocket, or what the page itself has been given.

/**
 * Connects to whichever there is. `told` gets messages, `seen` the bytes of pictures, `lost` is called when a
 * connection ends; it is tried again then.
 */
export function open({ told, seen, lost }) {
  const kept = document.getElementById('recording');
  return kept ? recording(JSON.parse(kept.textContent), { told, seen }) : server({ told, seen, lost });
}

function server({ told, seen, lost }) {
  let socket = null;
  let wait_ms = 250;
  const connect = () => {
    const query = new URLSearchParams(location.search);
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    socket = new WebSocket(`${scheme}://${location.host}/ws?token=${query.get('token') ?? ''}`);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => { wait_ms = 250; };
    socket.onmessage = ({ data }) => (typeof data === 'string' ? told(JSON.parse(data)) : seen(data));
    socket.onclose = () => {
      lost();
      setTimeout(connect, wait_ms);
      wait_ms = Math.min(2 * wait_ms, 4000);
    };
  };
  connect();
  return {
    say(request) { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request)); },
    get socket() { return socket; },
  };
}

/** A run that is in the page: what is told first, and a picture of each frame, the first with the surfaces at rest. */
function recording({ state, pictures }, { told, seen }) {
  const unpack = async (frame) => {
    const packed = Uint8Array.from(atob(pictures[frame]), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
    seen(await new Response(stream).arrayBuffer());
  };
  // One after the other: the first has what the others are changes of.
  let before = Promise.resolve();
  const show = (frame) => { before = before.then(() => unpack(frame)); };
  queueMicrotask(() => { told(state); show(0); });
  return { say(request) { if (request.do === 'seek') show(request.frame); }, socket: null };
}
