/** The connection of a page to its program, and what the page says of it. */

const AGAIN = 1000; // [ms] until a lost connection is tried again
const SAID = 6000; // [ms] that a message stays

let quiet = 0;

/**
 * Connects a page to its program, again whenever that is lost.
 * @param {string} path of the server
 * @param {Object<string, function(Object): void>} heard what is done by the type of a message
 * @param {function(): void} lost is called when the connection has ended
 * @returns {function(Object): void} sends a message, if there is a connection
 */
export function connected(path, heard, lost) {
  let socket = null;
  const connect = () => {
    socket = new WebSocket(`ws://${window.location.host}${path}`);
    socket.addEventListener('message', ({ data }) => {
      const message = JSON.parse(data);
      heard[message.type]?.(message);
    });
    socket.addEventListener('close', () => {
      lost();
      setTimeout(connect, AGAIN);
    });
  };
  connect();
  return (message) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
}

/** Shows a message for some time. */
export function say(text) {
  const said = document.getElementById('said');
  said.textContent = text;
  said.hidden = false;
  clearTimeout(quiet);
  quiet = setTimeout(() => { said.hidden = true; }, SAID);
}
