// Shows the server the token in the fragment of the address, and goes on to the page with its cookie.

/** `#token=TOKEN&VIEW`: VIEW is what the page opens first. */
async function enter() {
  const [, token, view] = /^#token=([\w-]+)&?(.*)$/.exec(location.hash) ?? [];
  document.getElementById("shut").hidden = true;
  history.replaceState(null, "", location.pathname);
  if (token && await admitted(token)) location.replace(view ? `/#${view}` : "/");
  else document.getElementById("shut").hidden = false;
}

async function admitted(token) {
  try {
    const headers = { "Content-Type": "application/json" };
    return (await fetch("/api/session", { method: "POST", headers, body: JSON.stringify({ token }) })).ok;
  } catch {
    return false;
  }
}

addEventListener("hashchange", () => { if (location.hash) enter(); });
enter();
