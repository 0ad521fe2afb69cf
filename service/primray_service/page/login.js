// The page in place of an answer that needs a key (login.html). A browser sends no cookie after a link from another site:
// whoever is logged in already proceeds to the answer, everybody else enters the key first.

import { keyForm } from "./key_form.js";

const proceed = () => location.replace(location.href);

const known = await fetch("/v1/whoami", { headers: { accept: "application/json" } });
if (known.ok) proceed();
else keyForm(null, proceed);
