// Asks for the token in the page's own dialog; both pages have the same one.

export function askForToken(wasWrong) {
  return new Promise(resolve => {
    const dialog = document.getElementById("ask");
    const form = dialog.querySelector("form");
    const input = document.getElementById("token");
    document.getElementById("ask-wrong").hidden = !wasWrong;
    const take = event => {
      event.preventDefault();
      const token = input.value.trim();
      // Anything else cannot stand in a header.
      if (!/^[A-Za-z0-9\-._~+/=]+$/.test(token)) {
        document.getElementById("ask-wrong").hidden = false;
        return;
      }
      form.removeEventListener("submit", take);
      input.value = "";
      dialog.close();
      resolve(token);
    };
    form.addEventListener("submit", take);
    dialog.addEventListener("cancel", event => event.preventDefault());
    dialog.showModal();
    input.focus();
  });
}
