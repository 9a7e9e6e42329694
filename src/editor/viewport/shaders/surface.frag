in vec4 v_tinted;
#ifdef IMAGES
in vec3 v_plain;
in vec2 v_uv;
in vec2 v_glow_uv;

uniform sampler2D image;
uniform sampler2D glow_image;
uniform bool has_image;
uniform bool has_glow_image;
uniform vec3 glow;
#endif
// What multiplies alpha; the alpha below which there is nothing; 1 where vertices' and the image's alpha count.
uniform vec3 alpha;
#ifndef ENCODED
uniform float exposure;
uniform bool is_linear;
#endif

out vec4 seen;

void main() {
    vec4 texel = vec4(1.0);
    vec3 light = vec3(0.0);
#ifdef IMAGES
    light = v_plain;
    if (has_image) {
        texel = texture(image, v_uv);
    }
    if (has_glow_image) {
        light += glow * texture(glow_image, v_glow_uv).rgb;
    }
#endif
    float here = alpha.x * (alpha.z > 0.5 ? texel.a * v_tinted.a : 1.0);
#ifdef HOLES
    if (here < alpha.y) {
        discard;
    }
    here = 1.0;
#endif
    light += v_tinted.rgb * texel.rgb;
#ifdef ENCODED
    seen = vec4(light * here, here);
#else
    seen = vec4(encoded(light * exposure, is_linear) * here, here);
#endif
}
