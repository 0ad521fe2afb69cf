// The page in place of an answer that needs a key (login.html): who is logged in already goes on to it, as after a link from
// elsewhere, with which a browser sends no cookie; everybody else is asked for the key first.

import { keyForm } from "./key_form.js";

const proceed = () => location.replace(location.href);

const known = await fetch("/v1/whoami", { headers: { accept: "application/json" } });
if (known.ok) proceed();
else keyForm(null, proceed);
