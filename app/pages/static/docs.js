// Interactive OpenAPI description; all files come from this service.
"use strict";

const place = document.getElementById("interface");
SwaggerUIBundle({
  url: place.dataset.description,
  domNode: place,
  presets: [SwaggerUIBundle.presets.apis],
  deepLinking: true,
  validatorUrl: null,
  defaultModelsExpandDepth: 0,
});
