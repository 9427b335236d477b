/** Keeps the screen on while the page is visible, where the browser supports it. */

export function setUp() {
  document.addEventListener("visibilitychange", ask);
  ask();
}

function ask() {
  if (document.visibilityState !== "visible" || !("wakeLock" in navigator)) return;
  navigator.wakeLock.request("screen").catch(() => {}); // refused on low battery, for example; not essential
}
