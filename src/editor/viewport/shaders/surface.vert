// The shading formula at a vertex: what the diffuse texture multiplies, and what it does not.
//
// LIGHTS is their number; IMAGES, GLOSSY, MIRRORS and NEAR_LIGHTS are defined where there are such. Where the processor draws,
// both ways of a branch take their time. ENCODED is defined where triangles are so small that colours may be made bytes'
// at vertices.
in vec3 position;
in vec4 normal;
#ifdef IMAGES
in vec4 uvs;
#endif
in vec4 color;

uniform mat4 to_clip;
uniform mat4 to_world;
uniform mat4 normal_to_world;
// The eye, relative to the same origin as the lights, and 1; or the vector towards it and 0.
uniform vec4 eye;

#if LIGHTS > 0
uniform vec4 light_places[LIGHTS];
uniform vec4 light_colors[LIGHTS];
#ifdef NEAR_LIGHTS
uniform vec4 light_cones[LIGHTS];
uniform float light_rims[LIGHTS];
#endif
#endif

uniform vec3 tinted;
uniform vec3 diffuse;
uniform vec3 steady;
uniform vec4 shine;
uniform vec3 mirror;
uniform vec3 sky_bottom;
uniform vec3 sky_top;
uniform vec3 sky_up;
#ifdef IMAGES
uniform vec4 uv_matrix;
uniform vec4 uv_offset;
uniform vec4 glow_matrix;
uniform vec4 glow_offset;
#endif

#ifdef ENCODED
uniform float exposure;
uniform bool is_linear;
#endif

out vec4 v_tinted;
#ifdef IMAGES
out vec3 v_plain;
out vec2 v_uv;
out vec2 v_glow_uv;
#endif

#ifdef IMAGES
vec2 placed(vec4 matrix, vec4 offset) {
    vec2 uv = offset.z > 0.5 ? uvs.zw : uvs.xy;
    vec2 at = matrix.xy * uv.x + matrix.zw * uv.y + offset.xy;
    // Images have their first row at the top.
    return vec2(at.x, 1.0 - at.y);
}
#endif

void main() {
    gl_Position = to_clip * vec4(position, 1.0);
#ifdef IMAGES
    v_uv = placed(uv_matrix, uv_offset);
    v_glow_uv = placed(glow_matrix, glow_offset);
#endif

    vec3 at = (to_world * vec4(position, 1.0)).xyz;
    vec3 to_eye = eye.xyz - at * eye.w;
    vec3 n = normalize((normal_to_world * vec4(normal.xyz, 0.0)).xyz);
    // Both sides are lit.
    n = dot(n, to_eye) < 0.0 ? -n : n;
    vec3 plain = steady;
#if defined(GLOSSY) || defined(MIRRORS)
    to_eye = normalize(to_eye);
    vec3 reflected = 2.0 * dot(n, to_eye) * n - to_eye;
#endif

    vec3 lit = vec3(0.0);
#if LIGHTS > 0
    for (int i = 0; i < LIGHTS; i++) {
        vec4 place = light_places[i];
        vec3 arriving = light_colors[i].xyz;
#ifdef NEAR_LIGHTS
        vec3 offset = place.xyz - at * place.w;
        float squared = dot(offset, offset);
        vec3 l = offset * inversesqrt(squared);
        vec4 cone = light_cones[i];
        float cosine = -dot(l, cone.xyz);
        float share = clamp((cosine - light_rims[i]) / max(cone.w - light_rims[i], 1e-6), 0.0, 1.0);
        arriving *= cone.w < -1.5 || cosine >= cone.w ? 1.0 : share * share;
        arriving *= light_colors[i].w > 0.5 ? 1.0 / squared : 1.0;
#else
        vec3 l = place.xyz;
#endif
        float n_dot_l = dot(n, l);
        lit += arriving * max(n_dot_l, 0.0);
#ifdef GLOSSY
        // R.V with the eye mirrored, not the light: the same.
        float r_dot_v = n_dot_l > 0.0 ? dot(reflected, l) : 0.0;
        plain += shine.xyz * arriving * (r_dot_v > 0.0 ? pow(r_dot_v, shine.w) : 0.0);
#endif
    }
#endif
#ifdef MIRRORS
    plain += mirror * mix(sky_bottom, sky_top, 0.5 + 0.5 * dot(reflected, sky_up));
#endif
    v_tinted = vec4((tinted + diffuse * lit) * color.rgb, color.a);
#ifdef IMAGES
    v_plain = plain;
#else
    v_tinted.rgb += plain;
#endif
#ifdef ENCODED
    v_tinted.rgb = encoded(v_tinted.rgb * exposure, is_linear);
#endif
}
