// The line to what owns the board: a WebSocket to `takt live PORT serve`.

/** Opens the line; `events` hears `opened()`, `message(text)` and `closed()`. */
export function open(events) {
  const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
  socket.addEventListener("open", events.opened);
  socket.addEventListener("message", ({ data }) => events.message(data));
  socket.addEventListener("close", events.closed);
  return {
    isOpen: () => socket.readyState === WebSocket.OPEN,
    send: (text) => socket.send(text),
  };
}
